"""GDAL as it is used from Python, dataset open and files warm: milliseconds for a map of each box.

Arguments: photo or height, the file, side in pixels. Standard input: a box a line, west south east north in the file's own
system. Standard output: milliseconds a line.
"""

import sys
import time

from osgeo import gdal

gdal.UseExceptions()
kind, path, side = sys.argv[1], sys.argv[2], int(sys.argv[3])
dataset = gdal.Open(path)
x, dx, _, y, _, dy = dataset.GetGeoTransform()
memory = gdal.GetDriverByName("MEM")


def photo(window):
    pixels = dataset.ReadRaster(*window, buf_xsize=side, buf_ysize=side, band_list=[1, 2, 3],
                                resample_alg=gdal.GRIORA_Bilinear)
    picture = memory.Create("", side, side, 3, gdal.GDT_Byte)
    picture.WriteRaster(0, 0, side, side, pixels)
    gdal.GetDriverByName("JPEG").CreateCopy("/vsimem/tile.jpg", picture, options=["QUALITY=85"])
    return "/vsimem/tile.jpg"


def height(window):
    samples = dataset.ReadRaster(*window, buf_xsize=side, buf_ysize=side, buf_type=gdal.GDT_UInt16,
                                 resample_alg=gdal.GRIORA_Bilinear)
    picture = memory.Create("", side, side, 1, gdal.GDT_UInt16)
    picture.WriteRaster(0, 0, side, side, samples)
    gdal.GetDriverByName("PNG").CreateCopy("/vsimem/tile.png", picture)
    return "/vsimem/tile.png"


make = {"photo": photo, "height": height}[kind]
for line in sys.stdin:
    west, south, east, north = map(float, line.split())
    start = time.perf_counter()
    left, top = (west - x) / dx, (north - y) / dy
    name = make((left, top, (east - west) / dx, (south - north) / dy))
    # The bytes, as they would be sent.
    size = gdal.VSIStatL(name).size
    handle = gdal.VSIFOpenL(name, "rb")
    body = gdal.VSIFReadL(1, size, handle)
    gdal.VSIFCloseL(handle)
    print((time.perf_counter() - start) * 1e3, flush=True)
