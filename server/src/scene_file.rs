//! `scene.toml`, as people write it.
//!
//! ```toml
//! name = "Lolo National Forest"
//! seed = 7
//!
//! [dem]
//! path = "dem.tif"
//! attribution = "LANDFIRE"
//!
//! [land_cover]
//! path = "fuel.tif"
//! classes.165 = { species = "spruce", closure = 0.8, height = 22 }
//! classes.98 = { surface = "water" }
//! ```
//!
//! Paths are relative to the file; an `https://` address of a cloud-optimised GeoTIFF does as well. Everything but `[dem]` may be left out.

use crate::source::growth::Growths;
use crate::source::upstream;
use crate::source::upstream::pictures::DEEPEST_ZOOM;
use crate::source::upstream::wms::is_wms;
use crate::species_setting::{self, SpeciesSetting, growth_of};
use crate::toml_file;
use crate::user_error::UserError;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use treeline_core::camera::GeographicCamera;
use treeline_core::codec::land_cover::CodeBits;
use treeline_core::layer::SurfaceType;
use treeline_core::scene::Place;
use treeline_core::seeds::Species;
use treeline_core::tile::GeographicBox;

/// What is shown.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SceneFile {
    /// For people. Default: the terrain's file name.
    pub name: Option<String>,
    /// Grows another forest. Default: 1.
    pub seed: Option<u32>,
    /// Shown beside the picture, beside what the sources say.
    pub attribution: Vec<String>,
    /// Bits of a land-cover code: 8, 16 or 32. Default: 16, or what the number of species needs.
    pub land_cover_bits: Option<u8>,
    /// Terrain.
    pub dem: Option<DemSource>,
    /// Photo.
    pub photo: Option<PhotoSource>,
    /// Classes of land cover.
    #[serde(alias = "land-cover")]
    pub land_cover: Option<LandCoverSource>,
    /// Height of the canopy over the ground.
    #[serde(alias = "canopy-height")]
    pub canopy_height: Option<CanopyHeightSource>,
    /// A scanned or rendered map whose green tint says where forest is.
    #[serde(alias = "topographic-map")]
    pub topographic_map: Option<TopographicMapSource>,
    /// Where the sun stands.
    pub sun: Option<SunSetting>,
    /// The view that a visitor starts with. Default: from the south over the highest terrain.
    pub camera: Option<GeographicCamera>,
    /// Named views.
    pub places: Vec<Place>,
    /// Species beside the built-in ones, codes 13 and up in this order, and built-in ones that are to be otherwise.
    pub species: Vec<SpeciesSetting>,
}

/// `[dem]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DemSource {
    /// The GeoTIFF; or the address of a WMS with its layer, `https://…/wms?LAYERS=…`, of which [`Self::bbox`] is fetched.
    pub path: PathBuf,
    /// `EPSG:N`, in place of what the file says.
    #[serde(default)]
    pub crs: Option<String>,
    /// Value that stands for no data, beside what the file says.
    #[serde(default)]
    pub nodata: Option<f64>,
    /// Must be shown beside the picture.
    #[serde(default)]
    pub attribution: Option<String>,
    /// Heights are multiplied by this (0.3048 for feet). Default: 1.
    #[serde(default)]
    pub vertical_scale: Option<f64>,
    /// Then this is added, metres. Default: 0.
    #[serde(default)]
    pub vertical_offset: Option<f64>,
    /// West, south, east, north of what is fetched of a WMS, degrees.
    #[serde(default)]
    pub bbox: Option<[f64; 4]>,
    /// Distance of the heights that are fetched of a WMS, metres. Default: what makes some four million of them.
    #[serde(default)]
    pub resolution_metres: Option<f64>,
}

impl DemSource {
    /// What is fetched of a service.
    pub fn bounds(&self) -> Option<GeographicBox> {
        self.bbox.map(|[west, south, east, north]| GeographicBox { west, south, east, north })
    }

    fn check(&self) -> Result<(), String> {
        let scale = self.vertical_scale.unwrap_or(1.0);
        if !(scale.is_finite() && scale != 0.0) {
            return Err(format!("dem.vertical_scale is {scale}; it must be a number other than 0"));
        }
        let offset = self.vertical_offset.unwrap_or(0.0);
        if !(-1e5..=1e5).contains(&offset) {
            return Err(format!("dem.vertical_offset is {offset}; it must lie within 100000 m"));
        }
        if let Some([west, south, east, north]) = self.bbox {
            let stands = (-180.0..=360.0).contains(&west) && -90.0 <= south && south < north && north <= 90.0;
            if !(stands && west < east && east - west <= 360.0) {
                return Err(format!(
                    "dem.bbox is [{west}, {south}, {east}, {north}]; it is west, south, east, north in degrees"
                ));
            }
        }
        if let Some(metres) = self.resolution_metres
            && !(metres.is_finite() && metres > 0.0)
        {
            return Err(format!("dem.resolution_metres is {metres}; it must be more than 0"));
        }
        if !is_wms(&self.path) && (self.bbox.is_some() || self.resolution_metres.is_some()) {
            return Err(
                "dem.bbox and dem.resolution_metres are for the address of a WMS; leave them out for a file"
                    .to_owned(),
            );
        }
        Ok(())
    }
}

/// `[photo]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PhotoSource {
    /// The GeoTIFF; or the address of a service of pictures: `https://…/{z}/{x}/{y}.jpg` (`{-y}` counts from the
    /// south), or a WMS with its layer, `https://…/wms?LAYERS=…`.
    pub path: PathBuf,
    /// Deepest zoom of a service. Default: 18, 0.6 m at the equator.
    #[serde(default)]
    pub maximum_zoom: Option<u8>,
    /// `EPSG:N`, in place of what the file says.
    #[serde(default)]
    pub crs: Option<String>,
    /// Value that stands for no data in every band.
    #[serde(default)]
    pub nodata: Option<f64>,
    /// Must be shown beside the picture.
    #[serde(default)]
    pub attribution: Option<String>,
}

/// `[land_cover]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LandCoverSource {
    /// The GeoTIFF.
    pub path: PathBuf,
    /// `EPSG:N`, in place of what the file says.
    #[serde(default)]
    pub crs: Option<String>,
    /// Value that stands for no data.
    #[serde(default)]
    pub nodata: Option<f64>,
    /// Must be shown beside the picture.
    #[serde(default)]
    pub attribution: Option<String>,
    /// What the raster's values mean. Default: a table that is known, recognised by its values.
    #[serde(default)]
    pub classes: BTreeMap<String, ClassSetting>,
}

/// What a value of the land-cover raster means.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ClassSetting {
    /// Name of the species that grows there, or of a group: "conifer", "broadleaf" or "mixed", of which height,
    /// slope and moisture choose. Default: nothing grows.
    pub species: Option<String>,
    /// Name of a second species.
    pub secondary: Option<String>,
    /// Its share of the trees, 0 to 1. Default: 0.3 where a second species is given.
    pub secondary_share: Option<f64>,
    /// Share of the ground under crowns, 0 to 1. Default: 1 where a species is given.
    pub closure: Option<f64>,
    /// Height of the stand, metres. Default: the species' own.
    pub height: Option<f64>,
    /// What the ground is: plain, water, rock, snow or grass. Default: plain.
    pub surface: Option<SurfaceType>,
}

/// `[canopy_height]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CanopyHeightSource {
    /// The GeoTIFF.
    pub path: PathBuf,
    /// `EPSG:N`, in place of what the file says.
    #[serde(default)]
    pub crs: Option<String>,
    /// Value that stands for no data.
    #[serde(default)]
    pub nodata: Option<f64>,
    /// Must be shown beside the picture.
    #[serde(default)]
    pub attribution: Option<String>,
    /// Metres for one unit of the raster (0.1 for decimetres). Default: 1.
    #[serde(default)]
    pub scale: Option<f64>,
}

/// `[topographic_map]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TopographicMapSource {
    /// The GeoTIFF.
    pub path: PathBuf,
    /// `EPSG:N`, in place of what the file says.
    #[serde(default)]
    pub crs: Option<String>,
    /// Must be shown beside the picture.
    #[serde(default)]
    pub attribution: Option<String>,
    /// Colours of forest, red, green and blue. Default: the map's green, found by itself.
    #[serde(default)]
    pub forest: Vec<[u8; 3]>,
    /// Colours of water. Default: whatever is blue.
    #[serde(default)]
    pub water: Vec<[u8; 3]>,
    /// Distance within which a colour is taken for a given one, of 255. Default: 24.
    #[serde(default)]
    pub tolerance: Option<f64>,
    /// What grows there, as in a class of land cover. Default: "mixed".
    #[serde(default)]
    pub species: Option<String>,
}

/// `[sun]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SunSetting {
    /// RFC 3339, for example `2026-07-15T09:00:00Z`, with quotes or without.
    #[serde(deserialize_with = "text_of_time")]
    pub time: String,
}

/// A time as text, or as TOML's own kind of time.
fn text_of_time<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<String, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Time {
        Text(String),
        Own(toml::value::Datetime),
    }
    match Time::deserialize(deserializer) {
        Ok(Time::Text(text)) => Ok(text),
        Ok(Time::Own(time)) => Ok(time.to_string()),
        Err(_) => Err(serde::de::Error::custom("it is no time; write UTC as in \"2026-07-15T09:00:00Z\"")),
    }
}

impl SceneFile {
    /// Reads a file and makes its paths relative to the working folder.
    pub fn read(path: &Path) -> Result<Self, UserError> {
        let mut scene: Self = toml_file::read(path)?;
        scene.check().map_err(|error| UserError::new(format!("{}: {error}", path.display())))?;
        if scene.dem.is_none() {
            return Err(UserError::new(format!(
                "{}: there is no [dem]; add [dem] with path = \"terrain.tif\"",
                path.display()
            )));
        }
        let folder = path.parent().unwrap_or(Path::new(""));
        for source in scene.paths_mut() {
            if !upstream::is_address(source) {
                *source = folder.join(&source);
            }
        }
        Ok(scene)
    }

    /// The paths of all sources.
    pub fn paths(&self) -> impl Iterator<Item = &Path> {
        [
            self.dem.as_ref().map(|source| source.path.as_path()),
            self.photo.as_ref().map(|source| source.path.as_path()),
            self.land_cover.as_ref().map(|source| source.path.as_path()),
            self.canopy_height.as_ref().map(|source| source.path.as_path()),
            self.topographic_map.as_ref().map(|source| source.path.as_path()),
        ]
        .into_iter()
        .flatten()
    }

    fn paths_mut(&mut self) -> impl Iterator<Item = &mut PathBuf> {
        [
            self.dem.as_mut().map(|source| &mut source.path),
            self.photo.as_mut().map(|source| &mut source.path),
            self.land_cover.as_mut().map(|source| &mut source.path),
            self.canopy_height.as_mut().map(|source| &mut source.path),
            self.topographic_map.as_mut().map(|source| &mut source.path),
        ]
        .into_iter()
        .flatten()
    }

    /// The species of the scene, prepared. The error names the species and its key.
    pub fn species_table(&self) -> Result<Vec<Species>, String> {
        species_setting::table(&self.species)
    }

    /// What is wrong with the values, naming the key, or `Ok`.
    pub fn check(&self) -> Result<(), String> {
        if self.paths().any(|path| path.as_os_str().is_empty()) {
            return Err("a path is empty; name the source's file".to_owned());
        }
        if let Some(zoom) = self.photo.as_ref().and_then(|photo| photo.maximum_zoom)
            && zoom > DEEPEST_ZOOM
        {
            return Err(format!("photo.maximum_zoom is {zoom}; the deepest is {DEEPEST_ZOOM}"));
        }
        if let Some(dem) = &self.dem {
            dem.check()?;
        }
        if let Some(scale) = self.canopy_height.as_ref().and_then(|canopy| canopy.scale)
            && !(scale.is_finite() && scale > 0.0)
        {
            return Err(format!("canopy_height.scale is {scale}; it must be more than 0"));
        }
        if let Some(cover) = &self.land_cover {
            let species = self.species_table()?;
            for (value, class) in &cover.classes {
                check_class(value, class)?;
                growth_of(&mut Growths::new(&species), &species, class)
                    .map_err(|error| format!("land_cover.classes.{value}.{error}"))?;
            }
        }
        if let Some(bits) = self.land_cover_bits
            && CodeBits::new(bits).is_none()
        {
            return Err(format!("land_cover_bits is {bits}; it must be 8, 16 or 32"));
        }
        let species = self.species_table()?;
        if let Some(map) = &self.topographic_map {
            if let Some(tolerance) = map.tolerance
                && !(1.0..=255.0).contains(&tolerance)
            {
                return Err(format!("topographic_map.tolerance is {tolerance}; it must lie in 1 to 255"));
            }
            let class = ClassSetting { species: map.species.clone(), ..ClassSetting::default() };
            growth_of(&mut Growths::new(&species), &species, &class)
                .map_err(|error| format!("topographic_map.{error}"))?;
        }
        if let Some(sun) = &self.sun {
            check_time(&sun.time)?;
        }
        if let Some(camera) = &self.camera {
            camera.check().map_err(|error| format!("camera.{error}"))?;
        }
        for place in &self.places {
            place.camera.check().map_err(|error| format!("the place \"{}\": camera.{error}", place.name))?;
        }
        Ok(())
    }
}

fn check_class(value: &str, class: &ClassSetting) -> Result<(), String> {
    if value.parse::<i64>().is_err() {
        return Err(format!(
            "land_cover.classes.{value}: \"{value}\" is no whole number; the keys are the raster's values"
        ));
    }
    if let Some(closure) = class.closure
        && !(0.0..=1.0).contains(&closure)
    {
        return Err(format!("land_cover.classes.{value}.closure is {closure}; it is a share from 0 to 1"));
    }
    if let Some(height) = class.height
        && !(0.0..=63.75).contains(&height)
    {
        return Err(format!("land_cover.classes.{value}.height is {height}; it must lie in 0 to 63.75 m"));
    }
    if let Some(share) = class.secondary_share
        && !(0.0..=1.0).contains(&share)
    {
        return Err(format!(
            "land_cover.classes.{value}.secondary_share is {share}; it is a share from 0 to 1"
        ));
    }
    if class.secondary.is_none() && class.secondary_share.is_some() {
        return Err(format!(
            "land_cover.classes.{value} has a secondary_share but no secondary species; add secondary = \"larch\""
        ));
    }
    if class.species.is_none() && class.secondary.is_some() {
        return Err(format!(
            "land_cover.classes.{value} has a secondary species but no species; add species = \"spruce\""
        ));
    }
    if class.species.is_none() && (class.closure.is_some() || class.height.is_some()) {
        return Err(format!(
            "land_cover.classes.{value} has a closure or height but no species; add species = \"spruce\""
        ));
    }
    if class.surface == Some(SurfaceType::Canopy) {
        return Err(format!(
            "land_cover.classes.{value}.surface is \"canopy\"; say what the ground is, and name a species for what grows"
        ));
    }
    Ok(())
}

/// Whether a text is a date and time as RFC 3339 has it, in UTC.
fn check_time(text: &str) -> Result<(), String> {
    let wrong = || format!("sun.time is \"{text}\"; write UTC as in 2026-07-15T09:00:00Z");
    let datetime: toml::value::Datetime = text.parse().map_err(|_| wrong())?;
    let utc =
        matches!(datetime.offset, Some(toml::value::Offset::Z | toml::value::Offset::Custom { minutes: 0 }));
    if datetime.date.is_some() && datetime.time.is_some() && utc { Ok(()) } else { Err(wrong()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<SceneFile, String> {
        let scene: SceneFile = toml_file::parse(text, "scene.toml").map_err(|error| error.to_string())?;
        scene.check()?;
        Ok(scene)
    }

    #[test]
    fn everything_that_there_is() {
        let scene = parse(
            r#"
            name = "A"
            seed = 3
            attribution = ["x"]
            [dem]
            path = "d.tif"
            crs = "EPSG:32632"
            nodata = -9999
            vertical_scale = 0.3048
            vertical_offset = -1.5
            [photo]
            path = "p.tif"
            attribution = "(c) y"
            [land-cover]
            path = "l.tif"
            classes.41 = { species = "beech", closure = 0.7, height = 20, surface = "grass" }
            classes.-1 = { surface = "water" }
            [canopy_height]
            path = "c.tif"
            scale = 0.1
            [topographic_map]
            path = "t.tif"
            [sun]
            time = "2026-07-15T09:00:00Z"
            [camera]
            lon = 10
            lat = 46
            height = 3000
            heading_deg = 0
            pitch_deg = -20
            [[places]]
            name = "Summit"
            camera = { lon = 10, lat = 46, height = 3000, heading_deg = 0, pitch_deg = -20 }
            [[species]]
            name = "European beech"
            lowest_metres = 12
            highest_metres = 24
            tallest_metres = 30
            crown_radius_ratio = 0.2
            crown_base_ratio = 0.4
            crown = "dome"
            trees_per_km2 = 12000
            colour = [90, 140, 60]
            "#,
        )
        .unwrap();
        assert_eq!(scene.dem.as_ref().unwrap().nodata, Some(-9999.0));
        assert_eq!(scene.land_cover.as_ref().unwrap().classes["41"].closure, Some(0.7));
        assert_eq!(scene.places[0].name, "Summit");
        let again: SceneFile = toml::from_str(&toml::to_string(&scene).unwrap()).unwrap();
        assert_eq!(again, scene);
    }

    #[test]
    fn every_mistake_is_named() {
        for (text, named) in [
            (
                "[dem]\npath='a'\nverticl_scale=1",
                "scene.toml:3: unknown key \"verticl_scale\"; did you mean \"vertical_scale\"?",
            ),
            ("[photto]\npath='a'", "scene.toml:1: unknown key \"photto\"; did you mean \"photo\"?"),
            ("[dem]\nnodata=3", "missing field `path`"),
            ("[dem]\npath='a'\nvertical_scale=0", "dem.vertical_scale is 0"),
            ("[dem]\npath='a'\nvertical_offset=nan", "dem.vertical_offset is NaN"),
            ("[dem]\npath='a'\nbbox=[8,46,9,47]", "leave them out for a file"),
            ("[dem]\npath='https://a.org/?LAYERS=x'\nbbox=[8,47,9,46]", "west, south, east, north"),
            ("[dem]\npath='https://a.org/?LAYERS=x'\nbbox=[8,nan,9,46]", "west, south, east, north"),
            ("[dem]\npath='https://a.org/?LAYERS=x'\nresolution_metres=0", "resolution_metres is 0"),
            ("[canopy_height]\npath='a'\nscale=-1", "canopy_height.scale is -1"),
            ("[land_cover]\npath='a'\nclasses.x={}", "\"x\" is no whole number"),
            ("[land_cover]\npath='a'\nclasses.1={species='a',closure=2}", "closure is 2"),
            ("[land_cover]\npath='a'\nclasses.1={species='a',height=100}", "height is 100"),
            ("[land_cover]\npath='a'\nclasses.1={closure=1}", "no species"),
            ("[land_cover]\npath='a'\nclasses.1={surface='lava'}", "lava"),
            (
                "[land_cover]\npath='a'\nclasses.1={species='larch',secondary_share=0.2}",
                "no secondary species",
            ),
            (
                "[land_cover]\npath='a'\nclasses.1={species='larch',secondary='spruce',secondary_share=2}",
                "secondary_share is 2",
            ),
            ("[land_cover]\npath='a'\nclasses.1={secondary='spruce'}", "but no species"),
            ("[topographic_map]\npath='a'\ntolerance=0", "topographic_map.tolerance is 0"),
            ("[topographic_map]\npath='a'\nspecies='fur'", "topographic_map.species is \"fur\""),
            ("land_cover_bits = 12", "land_cover_bits is 12"),
            ("[sun]\ntime='noon'", "sun.time is \"noon\""),
            ("[sun]\ntime='2026-07-15T09:00:00'", "write UTC"),
            ("[camera]\nlon=0\nlat=91\nheight=0\nheading_deg=0\npitch_deg=0", "camera.lat is 91"),
            ("[land_cover]\npath='a'\nclasses.1={species='spruse'}", "species is \"spruse\""),
            (
                "[[species]]\nname='oak'\nlowest_metres=0\nhighest_metres=3\ntallest_metres=9\ncrown_radius_ratio=0.2\ncrown_base_ratio=0.4\ncrown='dome'\ntrees_per_km2=9\ncolour=[1,2,3]",
                "lowest_metres is 0",
            ),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.contains(named) && !error.contains('\n'), "{text}: {error}");
        }
    }

    #[test]
    fn paths_belong_to_the_file_and_a_scene_has_terrain() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.toml");
        std::fs::write(&path, "[dem]\npath = \"d.tif\"\n[photo]\npath = \"/p.tif\"").unwrap();
        let scene = SceneFile::read(&path).unwrap();
        assert_eq!(scene.dem.unwrap().path, folder.path().join("d.tif"));
        assert_eq!(scene.photo.unwrap().path, Path::new("/p.tif"));
        std::fs::write(&path, "name = \"x\"").unwrap();
        assert!(SceneFile::read(&path).unwrap_err().to_string().contains("no [dem]"));
    }
}
