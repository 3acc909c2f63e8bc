"""GDAL as a client, by its WMS and WMTS drivers: what it reads is what the server answers when asked directly."""

import sys
import tempfile
import urllib.request

import numpy
from osgeo import gdal

gdal.UseExceptions()
# Its own is a folder wherever it is started.
CACHE = tempfile.TemporaryDirectory()
gdal.SetConfigOption("GDAL_DEFAULT_WMS_CACHE_PATH", CACHE.name)
BASE = sys.argv[1]
WEST, SOUTH, EAST, NORTH = 11.0, 46.9, 11.2, 47.0
WIDTH, HEIGHT = 256, 128


def check(condition, message):
    if not condition:
        sys.exit(message)


def direct(query):
    """The server's own answer, opened from memory."""
    body = urllib.request.urlopen(f"{BASE}/wms?SERVICE=WMS&VERSION=1.3.0&REQUEST=GetMap&STYLES=&{query}").read()
    gdal.FileFromMemBuffer("/vsimem/direct", body)
    return gdal.Open("/vsimem/direct").ReadAsArray()


def service(version, name, layer, image_format, bands, data_type):
    """GDAL's description of a WMS."""
    axes = "" if version == "1.1.1" else "<BBoxOrder>yxYX</BBoxOrder>"
    return f"""<GDAL_WMS>
      <Service name="WMS"><Version>{version}</Version><ServerUrl>{BASE}/wms?</ServerUrl><Layers>{layer}</Layers>
        <{name}>EPSG:4326</{name}><ImageFormat>{image_format}</ImageFormat>{axes}</Service>
      <DataWindow><UpperLeftX>{WEST}</UpperLeftX><UpperLeftY>{NORTH}</UpperLeftY><LowerRightX>{EAST}</LowerRightX>
        <LowerRightY>{SOUTH}</LowerRightY><SizeX>{WIDTH}</SizeX><SizeY>{HEIGHT}</SizeY></DataWindow>
      <Projection>EPSG:4326</Projection><BandsCount>{bands}</BandsCount><DataType>{data_type}</DataType>
      <BlockSizeX>{WIDTH}</BlockSizeX><BlockSizeY>{HEIGHT}</BlockSizeY><OverviewCount>0</OverviewCount>
    </GDAL_WMS>"""


box = f"CRS=CRS:84&BBOX={WEST},{SOUTH},{EAST},{NORTH}&WIDTH={WIDTH}&HEIGHT={HEIGHT}"
for version, name in (("1.1.1", "SRS"), ("1.3.0", "CRS")):
    read = gdal.Open(service(version, name, "texture", "image/png", 3, "Byte")).ReadAsArray()
    wanted = direct(f"LAYERS=texture&FORMAT=image/png&{box}")[:3]
    check(numpy.array_equal(read, wanted), f"{version}: other pixels of the photo")
    read = gdal.Open(service(version, name, "elevation", "image/tiff", 1, "Float32")).ReadAsArray()
    wanted = direct(f"LAYERS=elevation&FORMAT=image/tiff&{box}")
    check(numpy.array_equal(read, wanted), f"{version}: other heights")
    check(numpy.ptp(read) > 100, f"{version}: a mountain is flat")

found = gdal.Open(f"WMS:{BASE}/wms?SERVICE=WMS&VERSION=1.1.1&REQUEST=GetCapabilities").GetSubDatasets()
check(len(found) == 4, f"capabilities: {found}")

# WMTS, in the geographic set of 512-sample tiles: a window of whole tiles.
tiles = gdal.Open(f"WMTS:{BASE}/wmts/1.0.0/WMTSCapabilities.xml,layer=texture,tilematrixset=WebMercatorQuad")
check(tiles.RasterCount in (3, 4) and "3857" in tiles.GetProjection(), "WMTS: bands or projection")
west, step_x, _, north, _, step_y = tiles.GetGeoTransform()
middle = (tiles.RasterXSize // 2, tiles.RasterYSize // 2)
read = tiles.ReadAsArray(middle[0], middle[1], 64, 48)[:3]
left, top = west + middle[0] * step_x, north + middle[1] * step_y
mercator = f"CRS=EPSG:3857&BBOX={left},{top + 48 * step_y},{left + 64 * step_x},{top}&WIDTH=64&HEIGHT=48"
wanted = direct(f"LAYERS=texture&FORMAT=image/png&{mercator}")[:3]
difference = numpy.abs(read.astype(int) - wanted.astype(int)).mean()
check(difference < 3, f"WMTS: other pixels, by {difference} of 255")
print("GDAL: all right")
