//! What a camera sees, in f64: the geometry that tile choice and the frame share.

use glam::{DMat3, DVec3};
use treeline_core::camera::GeographicCamera;
use treeline_core::geodesy::{self, Geodetic};
use treeline_core::tile::GeographicBox;

/// An upper bound of the ellipsoid's radii of curvature, metres: what bends least hides least, so
/// culling with it never removes what can be seen.
const LARGEST_RADIUS_METRES: f64 = 6_400_000.0;

/// No eye is nearer to a pole than this, degrees of latitude (11 m): on the axis a metre is any number of degrees of
/// longitude, and rays down the axis would lose their place.
const FARTHEST_LATITUDE: f64 = 90.0 - 1e-4;

/// A camera with its picture's size.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewGeometry {
    /// The eye.
    pub eye: Geodetic,
    /// The eye, ECEF metres.
    pub eye_ecef: DVec3,
    /// Rotation from ECEF to east-north-up at the eye: `enu_from_ecef`.
    pub enu_from_ecef: DMat3,
    /// Camera's right axis, east-north-up at the eye.
    pub right: DVec3,
    /// Camera's up axis.
    pub up: DVec3,
    /// Camera's forward axis.
    pub forward: DVec3,
    /// Tangent of half the horizontal field of view.
    pub tangent_x: f64,
    /// Tangent of half the vertical field of view.
    pub tangent_y: f64,
    /// fov_y / height in pixels, radians: the design's pixel angle.
    pub pixel_angle: f64,
    /// Picture, pixels.
    pub size: [u32; 2],
}

impl ViewGeometry {
    /// Of a checked camera and a picture of at least one pixel. An eye over a pole is moved off it by 11 m.
    pub fn new(camera: &GeographicCamera, width: u32, height: u32) -> Self {
        let lat = camera.lat.clamp(-FARTHEST_LATITUDE, FARTHEST_LATITUDE);
        let camera = &GeographicCamera { lat, ..*camera };
        let (width, height) = (width.max(1), height.max(1));
        let eye = camera.place();
        let axes = camera.enu_from_view();
        let fov_y = camera.fov_y_deg.to_radians();
        let tangent_y = (0.5 * fov_y).tan();
        Self {
            eye,
            eye_ecef: camera.eye_ecef(),
            enu_from_ecef: geodesy::ecef_from_enu(camera.lon, camera.lat).transpose(),
            right: axes.x_axis,
            up: axes.y_axis,
            forward: -axes.z_axis,
            tangent_x: tangent_y * f64::from(width) / f64::from(height),
            tangent_y,
            pixel_angle: fov_y / f64::from(height),
            size: [width, height],
        }
    }

    /// Unit direction, east-north-up at the eye, of a picture position in pixels from the top left
    /// (a pixel's centre is at + 0.5).
    pub fn direction(&self, x: f64, y: f64) -> DVec3 {
        let across = (2.0 * x / f64::from(self.size[0]) - 1.0) * self.tangent_x;
        let upward = (1.0 - 2.0 * y / f64::from(self.size[1])) * self.tangent_y;
        (self.forward + self.right * across + self.up * upward).normalize()
    }

    /// The place at an offset in metres from the eye (east-north-up at the eye).
    pub fn geodetic(&self, offset: DVec3) -> Geodetic {
        geodesy::geodetic_from_ecef(self.eye_ecef + self.enu_from_ecef.transpose() * offset)
    }

    /// Inward normals of the frustum's four sides, all through the eye.
    pub fn side_normals(&self) -> [DVec3; 4] {
        [
            self.forward * self.tangent_x + self.right,
            self.forward * self.tangent_x - self.right,
            self.forward * self.tangent_y + self.up,
            self.forward * self.tangent_y - self.up,
        ]
    }
}

/// An oriented box around everything between two heights over a geographic box, relative to the
/// eye: conservative, curvature included.
#[derive(Clone, Debug)]
pub struct Volume {
    /// Centre, east-north-up at the eye, metres from the eye.
    centre: DVec3,
    /// Unit axes (columns), east-north-up at the eye.
    axes: DMat3,
    /// Half lengths, metres.
    half: DVec3,
    maximum_height: f64,
}

impl Volume {
    /// Around `bounds` between the heights (metres).
    pub fn new(
        view: &ViewGeometry,
        bounds: &GeographicBox,
        minimum_height: f64,
        maximum_height: f64,
    ) -> Self {
        let (longitude, latitude) = bounds.centre();
        let frame = geodesy::ecef_from_enu(longitude, latitude);
        let to_frame = frame.transpose();
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for longitude in [bounds.west, longitude, bounds.east] {
            for latitude in [bounds.south, latitude, bounds.north] {
                for height in [minimum_height, maximum_height] {
                    let point = geodesy::ecef_from_geodetic(Geodetic { longitude, latitude, height });
                    let point = to_frame * (point - view.eye_ecef);
                    low = low.min(point);
                    high = high.max(point);
                }
            }
        }
        // Between samples an arc of angle δ rises by at most R(1 − cos δ/2) over its chord, along
        // each of the two directions.
        let step = 0.5 * (bounds.east - bounds.west).max(bounds.north - bounds.south).to_radians();
        let half_step_sine = (0.25 * step).sin();
        let rise =
            2.0 * (LARGEST_RADIUS_METRES + maximum_height.max(0.0)) * 2.0 * half_step_sine * half_step_sine;
        Self {
            centre: view.enu_from_ecef * frame * (0.5 * (low + high)),
            axes: view.enu_from_ecef * frame,
            half: 0.5 * (high - low) + DVec3::splat(rise + 1e-3),
            maximum_height,
        }
    }

    /// A lower bound of the distance from the eye, metres; 0 inside.
    pub fn distance(&self, view: &ViewGeometry) -> f64 {
        let eye = self.axes.transpose() * -self.centre;
        let outside = (eye.abs() - self.half).max(DVec3::ZERO);
        outside.length().max(view.eye.height - self.maximum_height)
    }

    /// Whether no ray of the picture can meet the volume, horizon aside.
    pub fn outside_frustum(&self, view: &ViewGeometry) -> bool {
        view.side_normals().iter().any(|normal| {
            let reach = self.half.x * normal.dot(self.axes.x_axis).abs()
                + self.half.y * normal.dot(self.axes.y_axis).abs()
                + self.half.z * normal.dot(self.axes.z_axis).abs();
            normal.dot(self.centre) + reach < 0.0
        })
    }

    /// Whether the ellipsoid itself, at the scene's lowest height, hides all of the volume.
    pub fn below_horizon(&self, view: &ViewGeometry, lowest_height: f64) -> bool {
        let eye_height = view.eye.height - lowest_height;
        if eye_height <= 0.0 {
            return false;
        }
        let reach = |height: f64| (height * (2.0 * LARGEST_RADIUS_METRES + height)).sqrt();
        let top = (self.maximum_height - lowest_height).max(0.0);
        let eye = self.axes.transpose() * -self.centre;
        (eye.abs() - self.half).max(DVec3::ZERO).length() > reach(eye_height) + reach(top)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use treeline_core::tile::TileAddress;

    fn camera(lon: f64, lat: f64, height: f64, heading_deg: f64, pitch_deg: f64) -> GeographicCamera {
        GeographicCamera { lon, lat, height, heading_deg, pitch_deg, fov_y_deg: 50.0 }
    }

    proptest! {
        /// Whatever point of a tile one takes: if it is in the picture the volume is too, and the
        /// distance is a lower bound.
        #[test]
        fn a_volume_is_conservative(
            level in 0_u8..=16, lon in -180.0..180.0_f64, lat in -89.0..89.0_f64, height in 0.0..3.0e6_f64,
            heading in 0.0..360.0_f64, pitch in -90.0..30.0_f64, east in -3.0..3.0_f64, north in -3.0..3.0_f64,
            x in 0.0..=1.0_f64, y in 0.0..=1.0_f64, z in 0.0..=1.0_f64,
        ) {
            let view = ViewGeometry::new(&camera(lon, lat, height, heading, pitch), 640, 480);
            let span = treeline_core::tile::span_degrees(level);
            let tile = TileAddress::at(level, lon + east * span, (lat + north * span).clamp(-90.0, 90.0)).bounds();
            let (minimum, maximum) = (-400.0, 8_000.0);
            let volume = Volume::new(&view, &tile, minimum, maximum);
            let place = Geodetic {
                longitude: tile.west + x * span, latitude: tile.south + y * span, height: minimum + z * (maximum - minimum),
            };
            let offset = view.enu_from_ecef * (geodesy::ecef_from_geodetic(place) - view.eye_ecef);
            prop_assert!(volume.distance(&view) <= offset.length() + 1e-6, "{} {}", volume.distance(&view), offset.length());
            let ahead = offset.dot(view.forward);
            let seen = ahead > 0.0
                && offset.dot(view.right).abs() <= ahead * view.tangent_x
                && offset.dot(view.up).abs() <= ahead * view.tangent_y;
            if seen {
                prop_assert!(!volume.outside_frustum(&view));
            }
        }

        /// A point that a straight line of sight reaches over the lowest sphere is not culled.
        #[test]
        fn the_horizon_hides_nothing_that_can_be_seen(lat in -80.0..80.0_f64, height in 1.0..1.0e5_f64, north in 0.0..12.0_f64, top in 0.0..5_000.0_f64) {
            let view = ViewGeometry::new(&camera(10.0, lat, height, 0.0, 0.0), 640, 480);
            let place = Geodetic { longitude: 10.0, latitude: (lat + north).min(89.0), height: top };
            let target = geodesy::ecef_from_geodetic(place);
            let lowest = (0..=400)
                .map(|i| geodesy::geodetic_from_ecef(view.eye_ecef.lerp(target, f64::from(i) / 400.0)).height)
                .fold(f64::INFINITY, f64::min);
            let tile = TileAddress::at(14, place.longitude, place.latitude).bounds();
            if lowest > 0.0 {
                prop_assert!(!Volume::new(&view, &tile, 0.0, top).below_horizon(&view, 0.0));
            }
        }
    }

    #[test]
    fn what_lies_behind_or_below_the_horizon_is_culled() {
        let view = ViewGeometry::new(&camera(10.0, 46.0, 2_000.0, 0.0, 0.0), 640, 480);
        let tile = |lat: f64| TileAddress::at(10, 10.0, lat).bounds();
        assert!(Volume::new(&view, &tile(45.0), 0.0, 500.0).outside_frustum(&view));
        assert!(!Volume::new(&view, &tile(47.0), 0.0, 500.0).outside_frustum(&view));
        assert!(Volume::new(&view, &tile(50.0), 0.0, 500.0).below_horizon(&view, 0.0));
        assert!(!Volume::new(&view, &tile(47.0), 0.0, 500.0).below_horizon(&view, 0.0));
    }

    #[test]
    fn directions_of_the_corners() {
        let view = ViewGeometry::new(&camera(0.0, 0.0, 10.0, 0.0, 0.0), 200, 100);
        assert!((view.direction(100.0, 50.0) - view.forward).length() < 1e-12);
        let corner = view.direction(0.0, 0.0);
        assert!((corner.dot(view.up) / corner.dot(view.forward) - view.tangent_y).abs() < 1e-12);
        assert!((corner.dot(view.right) / corner.dot(view.forward) + view.tangent_x).abs() < 1e-12);
    }
}
