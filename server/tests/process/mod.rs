//! The server as a process, and a terrain model for it.
#![allow(dead_code, reason = "each test file uses its part")]

pub mod hostile;
pub mod killed;

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use tiff::encoder::{TiffEncoder, TiffValue, colortype};
use tiff::tags::Tag;

/// Starts the server on a port that it picks; its address comes with it.
pub fn serve(arguments: &[&str]) -> (Child, String) {
    let mut child = Command::new(env!("CARGO_BIN_EXE_treeline"))
        .args(["serve", "--listen", "127.0.0.1:0"])
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
    let address = line.trim().strip_prefix("treeline: listening on http://").unwrap().to_owned();
    (child, address)
}

/// Status line, headers and body of a request.
pub fn get(address: &str, path: &str) -> (String, Vec<u8>) {
    exchange(address, format!("GET {path} HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n").as_bytes())
}

/// Status line, headers and body of the answer to a request as it goes over the wire, after which the connection closes.
pub fn exchange(address: &str, request: &[u8]) -> (String, Vec<u8>) {
    let mut stream = std::net::TcpStream::connect(address).unwrap();
    stream.write_all(request).unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap();
    let end = answer.windows(4).position(|window| window == b"\r\n\r\n").unwrap();
    (String::from_utf8_lossy(&answer[..end]).into_owned(), answer[end + 4..].to_vec())
}

/// A geographic GeoTIFF of so many columns and rows of 0.01°, eastward and southward of 10° E, 46.16° N. Heights by
/// column and row.
pub fn write_dem(path: &Path, side: u32, height: impl Fn(u32, u32) -> f32) {
    let heights: Vec<f32> = pixels(side).map(|(column, row)| height(column, row)).collect();
    write::<colortype::Gray32Float>(path, side, &heights);
}

/// A photo of the same place; red, green and blue by column and row.
pub fn write_photo(path: &Path, side: u32, colour: impl Fn(u32, u32) -> [u8; 3]) {
    let samples: Vec<u8> = pixels(side).flat_map(|(column, row)| colour(column, row)).collect();
    write::<colortype::RGB8>(path, side, &samples);
}

fn pixels(side: u32) -> impl Iterator<Item = (u32, u32)> {
    (0..side).flat_map(move |row| (0..side).map(move |column| (column, row)))
}

fn write<C: colortype::ColorType>(path: &Path, side: u32, samples: &[C::Inner])
where
    [C::Inner]: TiffValue,
{
    let mut encoder = TiffEncoder::new(std::fs::File::create(path).unwrap()).unwrap();
    let mut image = encoder.new_image::<C>(side, side).unwrap();
    // Strips of some rows, as files have them that are read by parts.
    image.rows_per_strip(64).unwrap();
    image.encoder().write_tag(Tag::ModelPixelScaleTag, &[0.01_f64, 0.01, 0.0][..]).unwrap();
    image.encoder().write_tag(Tag::ModelTiepointTag, &[0.0_f64, 0.0, 0.0, 10.0, 46.16, 0.0][..]).unwrap();
    let keys = [1_u16, 1, 0, 3, 1024, 0, 1, 2, 1025, 0, 1, 1, 2048, 0, 1, 4326];
    image.encoder().write_tag(Tag::GeoKeyDirectoryTag, &keys[..]).unwrap();
    image.write_data(samples).unwrap();
}
