//! CRS, BBOX, WIDTH and HEIGHT of a request: which numbers mean what.

use super::exception::ServiceException;
use super::version::Version;
use crate::http::order::geographic_grid;
use crate::http::query::{Parameters, number};
use crate::limits::Limits;
use crate::scene::Scene;
use crate::source::{RequestCrs, SampleGrid, crs};
use treeline_core::geodesy::geographic_from_web_mercator;
use treeline_core::layer::Layer;
use treeline_core::tile::GeographicBox;

/// A reference system as a request names it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReferenceSystem {
    /// What the numbers mean.
    pub crs: RequestCrs,
    /// Whether the first number of a pair goes north: latitude or northing first.
    pub northing_first: bool,
}

impl ReferenceSystem {
    /// Understands the CRS (1.3.0) or SRS (1.1.1) parameter.
    pub fn of_request(
        scene: &Scene,
        parameters: &Parameters,
        version: Version,
    ) -> Result<Self, ServiceException> {
        let name = version.reference_system_name();
        let example = if version == Version::V1_3_0 { "CRS:84" } else { "EPSG:4326" };
        // Old clients go on writing SRS in 1.3.0, and new ones CRS in 1.1.1; what the numbers mean is the version's word.
        let Some(text) = [name, "CRS", "SRS"].into_iter().find_map(|name| parameters.get(name)) else {
            return Err(parameters.require(name, example).err().unwrap_or_default().into());
        };
        Self::named(scene, text, version).ok_or_else(|| {
            let code = if version == Version::V1_3_0 { "InvalidCRS" } else { "InvalidSRS" };
            let known = Self::names(scene).join(", ");
            ServiceException::new(Some(code), format!("{name} is \"{text}\"; this scene has {known}"))
        })
    }

    /// The system of a name, if the scene is served in it.
    pub fn named(scene: &Scene, text: &str, version: Version) -> Option<Self> {
        let text = text.to_ascii_uppercase();
        let is_1_3_0 = version == Version::V1_3_0;
        let system = |crs, northing_first| Some(Self { crs, northing_first: northing_first && is_1_3_0 });
        match text.as_str() {
            "CRS:84" | "OGC:CRS84" => return system(RequestCrs::Geographic, false),
            "EPSG:4326" => return system(RequestCrs::Geographic, true),
            "EPSG:3857" => return system(RequestCrs::WebMercator, false),
            _ => {}
        }
        let epsg: u32 = text.strip_prefix("EPSG:")?.parse().ok()?;
        own_systems(scene).contains(&epsg).then_some(())?;
        if crs::is_geographic_code(epsg) {
            // Only those whose coordinates are WGS84's are among them.
            return system(RequestCrs::Geographic, true);
        }
        system(RequestCrs::Projected(epsg), crs::northing_first(epsg))
    }

    /// All names in which the scene is served.
    pub fn names(scene: &Scene) -> Vec<String> {
        let mut names = ["CRS:84", "EPSG:4326", "EPSG:3857"].map(str::to_owned).to_vec();
        names.extend(own_systems(scene).iter().map(|epsg| format!("EPSG:{epsg}")));
        names
    }

    /// Longitude and latitude of a point in east-north order, degrees.
    pub fn geographic(&self, x: f64, y: f64) -> Option<(f64, f64)> {
        match self.crs {
            RequestCrs::Geographic => Some((x, y)),
            RequestCrs::WebMercator => Some(geographic_from_web_mercator(x, y)),
            RequestCrs::Projected(epsg) => crs::Crs::from_epsg(epsg).ok()?.to_geographic(x, y).ok(),
        }
    }
}

/// EPSG codes of the systems that the scene's own rasters are in, besides those in which every scene is served.
pub fn own_systems(scene: &Scene) -> Vec<u32> {
    let mut codes: Vec<u32> = [
        scene.height.extent().projected_epsg,
        scene.colour.as_ref().and_then(|colour| colour.extent().projected_epsg),
        scene.cover.as_ref().and_then(|cover| cover.extent().projected_epsg),
    ]
    .into_iter()
    .flatten()
    .filter(|epsg| *epsg != 3857)
    .collect();
    codes.sort_unstable();
    codes.dedup();
    codes
}

/// A request's box in east-north order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RequestBox {
    /// Least easting or longitude.
    pub west: f64,
    /// Least northing or latitude.
    pub south: f64,
    /// Greatest easting or longitude.
    pub east: f64,
    /// Greatest northing or latitude.
    pub north: f64,
}

impl RequestBox {
    /// Understands BBOX in the order that the system has in the version.
    pub fn of_request(parameters: &Parameters, system: &ReferenceSystem) -> Result<Self, ServiceException> {
        let example = if system.northing_first { "46,10,47,11" } else { "10,46,11,47" };
        let text = parameters.require("BBOX", example)?;
        let numbers: Vec<f64> = text.split(',').map(|part| number("BBOX", part)).collect::<Result<_, _>>()?;
        let &[a, b, c, d] = numbers.as_slice() else {
            return Err(ServiceException::invalid(format!(
                "BBOX holds {} numbers; it needs four: {}",
                numbers.len(),
                if system.northing_first {
                    "south,west,north,east (this CRS has northing first)"
                } else {
                    "west,south,east,north"
                }
            )));
        };
        let (west, south, east, north) = if system.northing_first { (b, a, d, c) } else { (a, b, c, d) };
        let request = Self { west, south, east, north };
        request.check(system, text)?;
        Ok(request)
    }

    fn check(&self, system: &ReferenceSystem, text: &str) -> Result<(), ServiceException> {
        let order = if system.northing_first { "south,west,north,east" } else { "west,south,east,north" };
        for (low, high, low_name, high_name) in
            [(self.west, self.east, "west", "east"), (self.south, self.north, "south", "north")]
        {
            if low >= high {
                return Err(ServiceException::invalid(format!(
                    "BBOX={text}: {low_name} ({low}) must be less than {high_name} ({high}); the order here is {order}"
                )));
            }
        }
        // Far beyond the Earth there is nothing, and arithmetic there is of no use.
        let (x_limit, y_limit) = match system.crs {
            RequestCrs::Geographic => (900.0, 450.0),
            _ => (1e9, 1e9),
        };
        if self.west.abs().max(self.east.abs()) > x_limit || self.south.abs().max(self.north.abs()) > y_limit
        {
            return Err(ServiceException::invalid(format!(
                "BBOX={text} reaches far beyond the Earth; the order here is {order}, in {}",
                if system.crs == RequestCrs::Geographic { "degrees" } else { "metres" }
            )));
        }
        Ok(())
    }

    /// The grid of the box's pixels.
    pub fn grid(&self, layer: Layer, system: &ReferenceSystem, width: u32, height: u32) -> SampleGrid {
        let &Self { west, south, east, north } = self;
        match &system.crs {
            RequestCrs::Geographic => {
                geographic_grid(layer, &GeographicBox { west, south, east, north }, width, height)
            }
            crs => SampleGrid::Box { crs: crs.clone(), west, south, east, north, width, height },
        }
    }
}

/// WIDTH and HEIGHT within the limits.
pub fn size(parameters: &Parameters, limits: &Limits) -> Result<(u32, u32), ServiceException> {
    let side = |name: &str, limit: u32| {
        let text = parameters.require(name, "512")?;
        // Digits alone: "+4", " 4" and "4.0" are mistakes of whoever wrote them.
        let digits = text.bytes().all(|byte| byte.is_ascii_digit());
        match text.parse::<u32>() {
            Ok(value) if digits && (1..=limit).contains(&value) => Ok(value),
            _ => Err(format!("{name} is \"{text}\"; it must be a whole number from 1 to {limit}")),
        }
    };
    Ok((side("WIDTH", limits.maximum_width)?, side("HEIGHT", limits.maximum_height)?))
}
