//! NumPy's array files: 2-D floats in, a 2-D float32 out.

use treeline_shaders::height_field::Samples;

const MAGIC: &[u8; 6] = b"\x93NUMPY";

/// A 2-D array, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Rows.
    pub rows: u32,
    /// Columns.
    pub columns: u32,
    /// Samples.
    pub samples: Samples,
}

/// Reads a 2-D array of float32 or float64, of either byte order, in C or Fortran order. Errors say
/// what is wrong and the mend, without the file's name.
pub fn read(bytes: &[u8]) -> Result<Grid, String> {
    let too_short = || "it ends within its header; save it again with numpy.save".to_owned();
    let header = bytes.get(..8).ok_or_else(too_short)?;
    if &header[..6] != MAGIC {
        return Err("it is no .npy file; save it with numpy.save".into());
    }
    let (length, start) = match header[6] {
        1 => (bytes.get(8..10).map(|b| usize::from(u16::from_le_bytes([b[0], b[1]]))), 10),
        2 | 3 => (bytes.get(8..12).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize), 12),
        version => return Err(format!("it has .npy version {version}; versions 1 to 3 are read")),
    };
    let end = length.and_then(|length| length.checked_add(start)).ok_or_else(too_short)?;
    let text = bytes.get(start..end).ok_or_else(too_short)?;
    let text = std::str::from_utf8(text).map_err(|_| "its header is not text".to_owned())?;
    let kind = quoted(value(text, "descr")?)?;
    let fortran = match value(text, "fortran_order")? {
        order if order.starts_with("True") => true,
        order if order.starts_with("False") => false,
        _ => return Err("its header's fortran_order is neither True nor False".into()),
    };
    let shape = shape(value(text, "shape")?)?;
    let &[rows, columns] = shape.as_slice() else {
        return Err(format!("it has {} dimensions; a height field has 2: rows and columns", shape.len()));
    };
    let side = |count: usize| {
        u32::try_from(count)
            .map_err(|_| format!("it has {count} samples a side; that is more than can be drawn"))
    };
    let (rows, columns) = (side(rows)?, side(columns)?);
    let count = rows as usize * columns as usize;
    let data = &bytes[end..];
    let samples = match kind {
        "<f4" | "|f4" | "=f4" => {
            Samples::F32(ordered(numbers(data, count, f32::from_le_bytes)?, rows, columns, fortran))
        }
        ">f4" => Samples::F32(ordered(numbers(data, count, f32::from_be_bytes)?, rows, columns, fortran)),
        "<f8" | "|f8" | "=f8" => {
            Samples::F64(ordered(numbers(data, count, f64::from_le_bytes)?, rows, columns, fortran))
        }
        ">f8" => Samples::F64(ordered(numbers(data, count, f64::from_be_bytes)?, rows, columns, fortran)),
        other => {
            return Err(format!(
                "its samples are of type {other}; save it as float32 or float64 (array.astype('float32'))"
            ));
        }
    };
    Ok(Grid { rows, columns, samples })
}

/// The text after a key of the header's dictionary.
fn value<'a>(text: &'a str, key: &str) -> Result<&'a str, String> {
    ['\'', '"']
        .iter()
        .find_map(|quote| text.split_once(&format!("{quote}{key}{quote}")))
        .and_then(|(_, rest)| rest.trim_start().strip_prefix(':'))
        .map(str::trim_start)
        .ok_or_else(|| format!("its header lacks {key}; save it again with numpy.save"))
}

fn quoted(text: &str) -> Result<&str, String> {
    let quote = text.chars().next().filter(|c| matches!(c, '\'' | '"'));
    quote
        .and_then(|quote| text[1..].split_once(quote))
        .map(|(inner, _)| inner)
        .ok_or_else(|| "its samples are records; save one field as float32 or float64".to_owned())
}

fn shape(text: &str) -> Result<Vec<usize>, String> {
    text.strip_prefix('(')
        .and_then(|rest| rest.split_once(')'))
        .and_then(|(inner, _)| {
            inner
                .split(',')
                .map(str::trim)
                .filter(|part| !part.is_empty())
                .map(|part| part.parse().ok())
                .collect()
        })
        .ok_or_else(|| "its header's shape is no list of counts".to_owned())
}

fn numbers<T, const N: usize>(data: &[u8], count: usize, from: fn([u8; N]) -> T) -> Result<Vec<T>, String> {
    let wanted = count.saturating_mul(N);
    if data.len() < wanted {
        return Err(format!(
            "it has {} bytes of samples where its header promises {wanted}; it was cut off",
            data.len()
        ));
    }
    Ok(data[..wanted]
        .chunks_exact(N)
        .map(|bytes| {
            let mut sample = [0; N];
            sample.copy_from_slice(bytes);
            from(sample)
        })
        .collect())
}

/// Row-major samples.
fn ordered<T: Copy>(samples: Vec<T>, rows: u32, columns: u32, fortran: bool) -> Vec<T> {
    if !fortran {
        return samples;
    }
    let (rows, columns) = (rows as usize, columns as usize);
    (0..rows * columns).map(|index| samples[index % columns * rows + index / columns]).collect()
}

/// The bytes of a 2-D float32 array, row-major, little-endian.
pub fn write(rows: u32, columns: u32, samples: &[f32]) -> Vec<u8> {
    let mut header =
        format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({rows}, {columns}), }}").into_bytes();
    // The data begins at a multiple of 64, and the header ends with a line break.
    let padded = (10 + header.len() + 1).next_multiple_of(64) - 10;
    header.resize(padded - 1, b' ');
    header.push(b'\n');
    let mut bytes = Vec::with_capacity(10 + header.len() + 4 * samples.len());
    bytes.extend_from_slice(MAGIC);
    bytes.extend_from_slice(&[1, 0]);
    bytes.extend_from_slice(&(header.len() as u16).to_le_bytes());
    bytes.extend_from_slice(&header);
    for sample in samples {
        bytes.extend_from_slice(&sample.to_le_bytes());
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    fn npy(descr: &str, fortran: bool, shape: &str, data: &[u8]) -> Vec<u8> {
        let fortran = if fortran { "True" } else { "False" };
        let header = format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}\n");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
    }

    #[test]
    fn what_is_written_is_read() {
        let samples = vec![1.0, -2.5, f32::INFINITY, 4.0, 5.0, 6.0];
        let bytes = write(2, 3, &samples);
        assert_eq!(bytes.len() % 64, 24);
        assert_eq!(read(&bytes), Ok(Grid { rows: 2, columns: 3, samples: Samples::F32(samples) }));
    }

    #[test]
    fn every_order_of_bytes_and_axes() {
        let values = [1.0_f64, 2.0, 3.0, 4.0, 5.0, 6.0];
        let fortran = [1.0_f64, 4.0, 2.0, 5.0, 3.0, 6.0];
        let expected = Samples::F64(values.to_vec());
        let little: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        let big: Vec<u8> = fortran.iter().flat_map(|value| value.to_be_bytes()).collect();
        assert_eq!(read(&npy("<f8", false, "(2, 3)", &little)).unwrap().samples, expected);
        assert_eq!(read(&npy(">f8", true, "(2, 3)", &big)).unwrap().samples, expected);
        let single: Vec<u8> = values.iter().flat_map(|value| (*value as f32).to_be_bytes()).collect();
        assert_eq!(read(&npy(">f4", false, "(2,3)", &single)).unwrap().columns, 3);
    }

    #[test]
    fn what_is_wrong_is_said() {
        for (bytes, word) in [
            (b"II*\0 no npy".to_vec(), "no .npy"),
            (npy("<i4", false, "(1, 1)", &[0; 4]), "<i4"),
            (npy("<f4", false, "(4,)", &[0; 16]), "1 dimensions"),
            (npy("<f4", false, "(2, 2)", &[0; 12]), "cut off"),
            (npy("<f4", false, "(9999999999, 9999999999)", &[0; 12]), "more than"),
            (npy("<f4", false, "(4000000000, 4000000000)", &[0; 12]), "cut off"),
            (npy("<f4", false, "(a, 2)", &[0; 12]), "shape"),
            (b"\x93NUMPY\x01\x00\xff\xff".to_vec(), "header"),
            (b"\x93NUM".to_vec(), "header"),
        ] {
            let error = read(&bytes).unwrap_err();
            assert!(error.contains(word), "{error}");
        }
    }
}
