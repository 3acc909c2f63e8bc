//! What bytes may be.

use treeline_core::layer::Layer;

/// A format of tiles and maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Format {
    /// Signed 16-bit metres.
    Bil16,
    /// 32-bit float metres.
    Bil32,
    /// The same under World Wind's other name.
    XBil32,
    /// GeoTIFF, 32-bit float.
    GeoTiff,
    /// Treeline's own of the layer.
    Own,
    /// PNG.
    Png,
    /// JPEG.
    Jpeg,
    /// WebP, lossless.
    WebP,
}

impl Format {
    /// All formats.
    pub const ALL: [Self; 8] =
        [Self::Bil16, Self::Bil32, Self::XBil32, Self::GeoTiff, Self::Own, Self::Png, Self::Jpeg, Self::WebP];

    /// Whether it is to look at.
    pub fn is_picture(self) -> bool {
        matches!(self, Self::Png | Self::Jpeg | Self::WebP)
    }

    /// The media type by which the format is asked for on a layer.
    pub fn media_type(self, layer: Layer) -> &'static str {
        match self {
            Self::Bil16 => "application/bil16",
            Self::Bil32 => "application/bil32",
            Self::XBil32 => "image/x-bil;bits=32",
            Self::GeoTiff => "image/tiff",
            Self::Own => layer.row().client_format,
            Self::Png => "image/png",
            Self::Jpeg => "image/jpeg",
            Self::WebP => "image/webp",
        }
    }

    /// The format of a media type on a layer, where the layer is served in it.
    pub fn from_media_type(layer: Layer, media_type: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|format| format.serves(layer) && format.media_type(layer) == media_type)
    }

    /// The media type of the answer: the one asked for, without parameters.
    pub fn content_type(self, layer: Layer) -> &'static str {
        if self == Self::XBil32 { "image/x-bil" } else { self.media_type(layer) }
    }

    /// Whether the layer's row of the table lists the format.
    pub fn serves(self, layer: Layer) -> bool {
        // The photo's tiles are plain images.
        let own = self == Self::Own && layer == Layer::Texture;
        !own && layer.row().formats.contains(&self.media_type(layer))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use treeline_core::layer::LAYERS;

    #[test]
    fn every_media_type_of_the_table_is_a_format() {
        for row in LAYERS {
            for media_type in row.formats {
                let format = Format::from_media_type(row.layer, media_type);
                assert_eq!(format.map(|format| format.media_type(row.layer)), Some(*media_type));
            }
        }
        assert_eq!(Format::from_media_type(Layer::Texture, "image/jpeg"), Some(Format::Jpeg));
        assert_eq!(Format::from_media_type(Layer::Elevation, "image/jpeg"), None);
        assert_eq!(Format::XBil32.content_type(Layer::Elevation), "image/x-bil");
    }
}
