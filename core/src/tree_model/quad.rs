//! Corners and quads: all that a tree is made of on every level, and their packed form.

/// A corner of a quad, in the tree frame: x east, y north, z up, the trunk's foot at the origin, the
/// tree's height the unit of length.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Corner {
    /// Place, each coordinate in −1 … 1.
    pub position: [f32; 3],
    /// Place in the species' atlas, 0 … 1, v downwards.
    pub uv: [f32; 2],
    /// Direction for lighting, of length 1 or less. Foliage has the crown's soft normal, wood that of its
    /// surface. On a billboard cloud's planes it lies in the plane and is shorter, for both sides
    /// are seen: the drawing side adds [`super::TOWARDS_EYE`] times the direction to the eye.
    pub normal: [f32; 3],
    /// Place in the crown: 0 deep inside and below, 1 at its surface and top. See [`super::brightness`].
    pub shade: f32,
    /// 1 for foliage, which takes the season's and the ground's colour and may fall; 0 for wood and rock.
    pub foliage: f32,
}

/// Two triangles, of corners 0-1-2 and 0-2-3. One of which all corners are equal pads a variant and
/// draws nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Quad {
    /// Corners, in order round the quad.
    pub corners: [Corner; 4],
}

/// A corner as the GPU reads it, 16 bytes; WGSL's built-in functions unpack it:
///
/// | word | bits | what | by |
/// | --- | --- | --- | --- |
/// | 0 | 0 … 15, 16 … 31 | x, y | `unpack2x16snorm` |
/// | 1 | 0 … 15 | z | `unpack2x16snorm(w).x` |
/// | 1 | 16 … 23, 24 … 31 | shade, foliage | `unpack4x8unorm(w).zw` |
/// | 2 | 0 … 15, 16 … 31 | u, v | `unpack2x16unorm` |
/// | 3 | 0 … 23 | normal | `unpack4x8snorm(w).xyz` |
/// | 3 | 24 … 31 | 0 | |
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct PackedCorner {
    /// The words.
    pub words: [u32; 4],
}

impl Quad {
    /// The quad as it is after packing and unpacking: what both ends of the wire agree on.
    #[must_use]
    pub fn snapped(&self) -> Self {
        Self { corners: self.corners.map(|corner| PackedCorner::from(corner).into()) }
    }

    /// Places of its corners.
    pub fn places(&self) -> [glam::Vec3; 4] {
        self.corners.map(|corner| corner.position.into())
    }
}

impl From<Corner> for PackedCorner {
    fn from(corner: Corner) -> Self {
        let [x, y, z] = corner.position.map(|value| signed(value, 32_767.0) & 0xffff);
        let [u, v] = corner.uv.map(|value| unsigned(value, 65_535.0));
        let [normal_x, normal_y, normal_z] = corner.normal.map(|value| signed(value, 127.0) & 0xff);
        let (shade, foliage) = (unsigned(corner.shade, 255.0), unsigned(corner.foliage, 255.0));
        Self {
            words: [
                x | y << 16,
                z | shade << 16 | foliage << 24,
                u | v << 16,
                normal_x | normal_y << 8 | normal_z << 16,
            ],
        }
    }
}

impl From<PackedCorner> for Corner {
    fn from(packed: PackedCorner) -> Self {
        let [xy, z, uv, normal] = packed.words;
        let signed16 = |bits: u32| (f32::from(bits as u16 as i16) / 32_767.0).max(-1.0);
        let signed8 = |bits: u32| (f32::from(bits as u8 as i8) / 127.0).max(-1.0);
        let byte = |bits: u32| f32::from(bits as u8) / 255.0;
        let unsigned16 = |bits: u32| f32::from(bits as u16) / 65_535.0;
        Self {
            position: [signed16(xy), signed16(xy >> 16), signed16(z)],
            uv: [unsigned16(uv), unsigned16(uv >> 16)],
            normal: [signed8(normal), signed8(normal >> 8), signed8(normal >> 16)],
            shade: byte(z >> 16),
            foliage: byte(z >> 24),
        }
    }
}

/// A number of −1 … 1 as a signed integer's bits; NaN is 0.
fn signed(value: f32, scale: f32) -> u32 {
    (value.clamp(-1.0, 1.0) * scale).round() as i32 as u32
}

fn unsigned(value: f32, scale: f32) -> u32 {
    (value.clamp(0.0, 1.0) * scale).round() as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn packing_rounds_once(
            position in proptest::array::uniform3(-1.0..=1.0_f32),
            normal in proptest::array::uniform3(-1.0..=1.0_f32),
            uv in proptest::array::uniform2(0.0..=1.0_f32),
            shade in 0.0..=1.0_f32,
        ) {
            let corner = Corner { position, uv, normal, shade, foliage: 1.0 };
            let packed = PackedCorner::from(corner);
            let back = Corner::from(packed);
            prop_assert_eq!(PackedCorner::from(back), packed);
            for axis in 0..3 {
                prop_assert!((back.position[axis] - position[axis]).abs() < 1.6e-5);
                prop_assert!((back.normal[axis] - normal[axis]).abs() < 0.004);
            }
            prop_assert!((back.uv[0] - uv[0]).abs() < 8e-6 && (back.uv[1] - uv[1]).abs() < 8e-6);
            prop_assert!((back.shade - shade).abs() < 0.002);
        }
    }

    #[test]
    fn ends_and_nonsense() {
        let wild = Corner { position: [f32::NAN, 9.0, -9.0], foliage: f32::INFINITY, ..Corner::default() };
        let back = Corner::from(PackedCorner::from(wild));
        assert_eq!((back.position, back.foliage), ([0.0, 1.0, -1.0], 1.0));
        let lowest = Corner::from(PackedCorner { words: [0x8000_8000, 0x8000, 0, 0x80_8080] });
        assert_eq!((lowest.position, lowest.normal), ([-1.0; 3], [-1.0; 3]));
    }
}
