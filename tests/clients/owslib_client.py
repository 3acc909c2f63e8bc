"""OWSLib as a client: reads the capabilities, maps and heights of a running server; exits with a message where they are wrong."""

import json
import struct
import sys

from owslib.wms import WebMapService
from owslib.wmts import WebMapTileService

BASE = sys.argv[1]
LAYERS = {"elevation", "combined-elevation", "lcc", "texture"}
WEST, SOUTH, EAST, NORTH = 11.0, 46.9, 11.1, 46.95
WIDTH, HEIGHT = 20, 10


def floats(body):
    return struct.unpack(f"<{len(body) // 4}f", body)


def check(condition, message):
    if not condition:
        sys.exit(message)


def heights(wms, crs, box):
    answer = wms.getmap(
        layers=["elevation"], styles=[""], srs=crs, bbox=box, size=(WIDTH, HEIGHT), format="application/bil32"
    )
    check(answer.info()["Content-Type"] == "application/bil32", "the media type of heights")
    return floats(answer.read())


found = {}
for version in ("1.1.1", "1.3.0"):
    wms = WebMapService(f"{BASE}/wms", version=version)
    check(wms.identification.version == version, f"version {wms.identification.version}")
    check(set(wms.contents) == LAYERS, f"{version}: layers {set(wms.contents)}")
    operations = {operation.name for operation in wms.operations}
    check({"GetCapabilities", "GetMap", "GetFeatureInfo"} <= operations, f"{version}: {operations}")
    check(wms.getOperationByName("GetMap").formatOptions[0] == "image/png", f"{version}: formats")
    west, south, east, north = wms["texture"].boundingBoxWGS84
    check(west < WEST < EAST < east and south < SOUTH < NORTH < north, f"{version}: box of the photo")
    check("EPSG:3857" in wms["texture"].crsOptions, f"{version}: {wms['texture'].crsOptions}")
    check("legend" in wms["lcc"].styles["default"], f"{version}: no legend")
    found[version] = heights(wms, "EPSG:4326", (WEST, SOUTH, EAST, NORTH))
    picture = wms.getmap(
        layers=["texture", "lcc"],
        styles=["", ""],
        srs="EPSG:4326",
        bbox=(WEST, SOUTH, EAST, NORTH),
        size=(64, 32),
        format="image/png",
        transparent=True,
    )
    check(picture.read()[:8] == b"\x89PNG\r\n\x1a\n", f"{version}: no picture")

check(len(found["1.1.1"]) == WIDTH * HEIGHT, "so many heights")
check(found["1.1.1"] == found["1.3.0"], "the versions' axes lead to other places")
check(max(found["1.1.1"]) - min(found["1.1.1"]) > 50, "a mountain is flat")

# The height of a pixel is that of the place.
wms = WebMapService(f"{BASE}/wms", version="1.3.0")
info = wms.getfeatureinfo(
    layers=["elevation"],
    query_layers=["elevation"],
    srs="EPSG:4326",
    bbox=(WEST, SOUTH, EAST, NORTH),
    size=(WIDTH, HEIGHT),
    format="image/png",
    info_format="application/json",
    xy=(7, 3),
)
place = json.loads(info.read())
check(abs(place["elevation"] - found["1.3.0"][3 * WIDTH + 7]) < 0.01, f"GetFeatureInfo: {place}")

for address in (f"{BASE}/wmts", f"{BASE}/wmts/1.0.0/WMTSCapabilities.xml"):
    wmts = WebMapTileService(address)
    check(set(wmts.contents) == LAYERS, f"WMTS: {set(wmts.contents)}")
    matrix = wmts.tilematrixsets["WebMercatorQuad"].tilematrix["0"]
    check((matrix.matrixwidth, matrix.tilewidth) == (1, 256), "WMTS: the level 0 of Web Mercator")
    limits = wmts["texture"].tilematrixsetlinks["WebMercatorQuad"].tilematrixlimits["12"]
    tile = wmts.gettile(
        layer="texture",
        tilematrixset="WebMercatorQuad",
        tilematrix="12",
        row=limits.mintilerow,
        column=limits.mintilecol,
        format="image/jpeg",
    )
    check(tile.read()[:2] == b"\xff\xd8", "WMTS: no picture")
print("OWSLib: all right")
