//! Tests of the sources as a whole: on files written here, on real ones, and against GDAL.

mod cost;
mod data;
mod gdal;
mod hostile;
mod real;
mod synthetic;
