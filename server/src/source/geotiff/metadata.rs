//! What GDAL writes beside the samples: nodata, scale and offset.

use super::bytes::FileBytes;
use super::directory::{Directory, tag};
use crate::small_file::read_text;
use std::path::Path;

/// Longest `.aux.xml` that is read, bytes: histograms make some of them long.
const MAXIMUM_BYTES: u64 = 16 << 20;

/// Nodata as the file declares it. GDAL writes text; some writers end it with spaces or zeros.
pub fn nodata(bytes: &FileBytes, directory: &Directory) -> Option<f64> {
    parse_number(&directory.text(bytes, tag::GDAL_NODATA)?)
}

/// What `FILE.aux.xml` says of the first band: GDAL writes there what it may not write into the file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Beside {
    /// Nodata.
    pub nodata: Option<f64>,
    /// value = stored · scale + offset.
    pub scale: Option<f64>,
    /// See `scale`.
    pub offset: Option<f64>,
}

impl Beside {
    /// Reads the file beside a raster; nothing where there is none.
    pub fn read(path: &Path) -> Self {
        let mut name = path.as_os_str().to_owned();
        name.push(".aux.xml");
        read_text(Path::new(&name), MAXIMUM_BYTES).map_or(Self::default(), |xml| Self::parse(&xml))
    }

    fn parse(xml: &str) -> Self {
        let band = xml.split("<PAMRasterBand").skip(1).find_map(|band| {
            let (attributes, rest) = band.split_once('>')?;
            attributes.contains("band=\"1\"").then(|| rest.split("</PAMRasterBand>").next())?
        });
        let number = |element: &str| {
            band?.split(&format!("<{element}")).skip(1).find_map(|rest| {
                let (attributes, rest) = rest.split_once('>')?;
                // Not the beginning of a longer name.
                let whole = attributes.is_empty() || attributes.starts_with(' ');
                whole.then(|| parse_number(rest.split('<').next()?))?
            })
        };
        Self {
            nodata: number("NoDataValue"),
            scale: number("Scale").filter(|scale| scale.is_finite() && *scale != 0.0),
            offset: number("Offset").filter(|offset| offset.is_finite()),
        }
    }
}

/// A number as GDAL spells it, `nan`, `inf` and `-1.#IND` included.
pub fn parse_number(text: &str) -> Option<f64> {
    let text = text.trim_matches(|character: char| character.is_whitespace() || character == '\0');
    if text.contains("#IND") || text.contains("#QNAN") {
        return Some(f64::NAN);
    }
    text.parse().ok()
}

/// Scale and offset of a band (counted from 0): value = stored · scale + offset. What the file itself
/// says goes before what stands beside it.
pub fn scale_and_offset(bytes: &FileBytes, directory: &Directory, band: u16, beside: &Beside) -> (f64, f64) {
    let xml = directory.text(bytes, tag::GDAL_METADATA).unwrap_or_default();
    let item =
        |role: &str| item(&xml, role, band).and_then(|text| parse_number(&text)).filter(|v| v.is_finite());
    let scale = item("scale").filter(|&scale| scale != 0.0).or(beside.scale).unwrap_or(1.0);
    (scale, item("offset").or(beside.offset).unwrap_or(0.0))
}

/// Text of `<Item … sample="band" role="role">text</Item>`, whatever the order of the attributes.
fn item(xml: &str, role: &str, band: u16) -> Option<String> {
    xml.split("<Item").skip(1).find_map(|item| {
        let (attributes, rest) = item.split_once('>')?;
        let value = |name: &str| {
            let start = attributes.find(&format!("{name}=\""))? + name.len() + 2;
            attributes[start..].split('"').next()
        };
        let same_band = value("sample").map_or(band == 0, |sample| sample.parse() == Ok(band));
        (same_band && value("role") == Some(role))
            .then(|| rest.split('<').next().unwrap_or_default().to_owned())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_as_they_occur() {
        assert_eq!(parse_number("-9999 \0"), Some(-9999.0));
        assert_eq!(parse_number("3.4028235e+38"), Some(3.402_823_5e38));
        assert!(parse_number("nan").unwrap().is_nan());
        assert!(parse_number("-1.#IND").unwrap().is_nan());
        assert_eq!(parse_number("-1.7976931348623157e+308"), Some(f64::MIN));
        assert_eq!(parse_number("none"), None);
    }

    #[test]
    fn what_stands_beside() {
        let xml = r#"<PAMDataset><SRS>x</SRS><PAMRasterBand band="2"><NoDataValue>7</NoDataValue></PAMRasterBand>
            <PAMRasterBand band="1"><ScaleX>9</ScaleX><NoDataValue le_hex_equiv="00">-9.999E+03</NoDataValue>
            <Offset>-5</Offset><Scale>0.1</Scale></PAMRasterBand></PAMDataset>"#;
        let found = Beside::parse(xml);
        assert_eq!(found, Beside { nodata: Some(-9999.0), scale: Some(0.1), offset: Some(-5.0) });
        for garbage in [
            "",
            "<PAMRasterBand",
            "<PAMRasterBand band=\"1\"><NoDataValue>",
            "<PAMRasterBand band=\"1\"><Scale>0<",
        ] {
            assert_eq!(Beside::parse(garbage), Beside::default(), "{garbage}");
        }
        assert_eq!(Beside::read(Path::new("/nowhere/a.tif")), Beside::default());
    }

    #[test]
    fn items_by_band_and_role() {
        let xml = r#"<GDALMetadata><Item name="OFFSET" sample="0" role="offset">-5</Item>
            <Item name="SCALE" role="scale" sample="0">0.1</Item><Item name="SCALE" sample="1" role="scale">2</Item></GDALMetadata>"#;
        assert_eq!(item(xml, "scale", 0).unwrap(), "0.1");
        assert_eq!(item(xml, "scale", 1).unwrap(), "2");
        assert_eq!(item(xml, "offset", 0).unwrap(), "-5");
        assert_eq!(item(xml, "offset", 1), None);
    }
}
