//! From flags and `scene.toml` to an open scene.

use crate::cli::SceneArguments;
use crate::default_camera::default_camera;
use crate::revision::revision;
use crate::scene::Scene;
use crate::scene_file::{ClassSetting, LandCoverSource, SceneFile};
use crate::source::growth::{GrownCover, Growths};
use crate::source::open::{
    HeightOptions, SourceOptions, open_canopy_height, open_colour, open_height, open_land_cover, open_photo,
    open_topographic_map, photo_cover,
};
use crate::source::picture::map::MapKey;
use crate::source::raster_cover::LayeredCover;
use crate::source::raster_height::RasterHeight;
use crate::source::{ColourField, Cover, CoverField, FieldExtent, HeightField, procedural};
use crate::species_setting::growth_of;
use crate::user_error::UserError;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use treeline_core::codec::elevation::CANOPY_QUANTUM_METRES;
use treeline_core::codec::land_cover::CodeBits;
use treeline_core::seeds::Species;
use treeline_core::tile::GeographicBox;

/// Where the sun stands where nobody says: half past nine on a summer morning by the scene's own sun,
/// so that slopes have shape wherever on Earth they lie. RFC 3339, UTC.
fn default_sun_time(bounds: &GeographicBox) -> String {
    let (longitude, latitude) = bounds.centre();
    let month = if latitude < 0.0 { 1 } else { 7 };
    // The sun crosses 15° of longitude an hour; to the quarter hour is near enough, and stays on the day.
    let minutes = ((9.5 - longitude / 15.0) * 60.0).rem_euclid(1440.0);
    let minutes = (minutes / 15.0).round() as u32 * 15 % 1440;
    format!("2026-{month:02}-15T{:02}:{:02}:00Z", minutes / 60, minutes % 60)
}

/// The seed of the forest where nobody says.
const DEFAULT_SEED: u32 = 1;

/// Opens the scene that the flags describe; without any, the built-in one.
pub fn open(arguments: &SceneArguments) -> Result<Scene, UserError> {
    match arguments.scene_file()? {
        Some(file) => Ok(open_file(&file)?.scene),
        None => built_in(),
    }
}

/// The built-in landscape.
pub fn built_in() -> Result<Scene, UserError> {
    let defaults = procedural::scene_defaults();
    Ok(Scene {
        name: defaults.name,
        revision: revision(None)?,
        height: Arc::new(procedural::height()),
        colour: Some(Arc::new(procedural::colour())),
        cover: Some(Arc::new(procedural::cover())),
        species: Species::built_in(),
        growing: procedural::SPECIES.to_vec(),
        code_bits: CodeBits::default(),
        seed: defaults.seed,
        attribution: defaults.attribution,
        sun_time: defaults.sun_time,
        camera: defaults.camera,
        places: defaults.places,
    })
}

/// A scene from files, and what is to be said about each of them.
pub struct Opened {
    /// The scene.
    pub scene: Scene,
    /// What each source is for, and its description of several lines.
    pub facts: Vec<(&'static str, String)>,
}

/// Opens every source of a scene file, and fills in what it leaves open.
pub fn open_file(file: &SceneFile) -> Result<Opened, UserError> {
    file.check().map_err(UserError::new)?;
    let dem = file.dem.as_ref().ok_or_else(|| UserError::new("a scene needs terrain; add --dem FILE"))?;
    let species = file.species_table().map_err(UserError::new)?;
    let mut facts = Vec::new();

    let height = open_height(
        &dem.path,
        &HeightOptions {
            source: options(&dem.crs, dem.nodata),
            vertical_scale: dem.vertical_scale,
            vertical_offset: dem.vertical_offset,
            bounds: dem.bounds(),
            resolution_metres: dem.resolution_metres,
        },
    )?;
    facts.push(("terrain", height.describe().to_string()));
    let place = Place { path: &dem.path, extent: height.extent() };

    let mut colour: Option<Arc<dyn ColourField>> = None;
    if let Some(photo) = &file.photo {
        let opened = open_photo(
            &photo.path,
            &options(&photo.crs, photo.nodata),
            &place.extent.bounds,
            photo.maximum_zoom,
        )?;
        place.check_touches(&photo.path, opened.extent())?;
        facts.push(("photo", opened.describe().to_string()));
        colour = Some(opened);
    }
    let mut growths = Growths::new(&species);
    let below = open_cover(file, &species, &mut growths, &place, colour.as_ref(), &height, &mut facts)?;
    let seed = file.seed.unwrap_or(DEFAULT_SEED);
    let cover = below.map(|(below, grown)| {
        let growing = growths.species_of(&grown);
        let height = height.clone() as Arc<dyn HeightField>;
        (Arc::new(GrownCover::new(below, growths, height, seed)) as Arc<dyn CoverField>, growing)
    });
    let (cover, growing) = cover.map_or((None, Vec::new()), |(cover, growing)| (Some(cover), growing));
    let code_bits = code_bits(file, &species, &growing)?;
    let scene = Scene {
        name: file.name.clone().unwrap_or_else(|| name_of(&dem.path)),
        revision: revision(Some(file))?,
        colour,
        cover,
        species,
        code_bits,
        growing,
        seed,
        attribution: attribution(file),
        sun_time: file
            .sun
            .as_ref()
            .map_or_else(|| default_sun_time(&height.extent().bounds), |sun| sun.time.clone()),
        camera: match file.camera {
            Some(camera) => camera,
            None => default_camera(height.as_ref())?,
        },
        places: file.places.clone(),
        height,
    };
    Ok(Opened { scene, facts })
}

/// The bits of codes that the file asks for, or those that its species need.
fn code_bits(file: &SceneFile, species: &[Species], growing: &[u8]) -> Result<CodeBits, UserError> {
    let needed =
        |code: u8| [CodeBits::Eight, CodeBits::Sixteen].into_iter().find(|bits| code <= bits.largest_class());
    let Some(bits) = file.land_cover_bits.and_then(CodeBits::new) else {
        return Ok(CodeBits::for_classes(u8::try_from(species.len()).unwrap_or(u8::MAX)));
    };
    let Some(overflow) = growing.iter().find_map(|&code| bits.check(code).err()) else { return Ok(bits) };
    let largest = growing.iter().copied().max().unwrap_or(0);
    let name = species
        .get(usize::from(overflow.class).saturating_sub(1))
        .map_or("a species", |species| species.definition.name.as_str());
    Err(UserError::new(format!(
        "land_cover_bits is {}, whose codes end with {}, and {name} has code {}; say land_cover_bits = {}, or grow fewer species",
        overflow.bits,
        overflow.largest,
        overflow.class,
        needed(largest).unwrap_or(CodeBits::ThirtyTwo) as u8
    )))
}

/// Where the terrain is: other sources must touch it.
struct Place<'a> {
    path: &'a Path,
    extent: &'a FieldExtent,
}

impl Place<'_> {
    fn check_touches(&self, path: &Path, extent: &FieldExtent) -> Result<(), UserError> {
        let (here, there) = (&self.extent.bounds, &extent.bounds);
        if here.intersects(there) {
            return Ok(());
        }
        let text = |bounds: &GeographicBox| {
            format!(
                "{:.4} to {:.4}° E, {:.4} to {:.4}° N",
                bounds.west, bounds.east, bounds.south, bounds.north
            )
        };
        Err(UserError::new(format!(
            "{}: it lies at {}, away from the terrain {} at {}; check which files belong together and their CRSs (crs = \"EPSG:N\" in scene.toml overrides a file's)",
            path.display(),
            text(there),
            self.path.display(),
            text(here)
        )))
    }
}

/// A cover of growths, and the growths that it may have.
type Below = (Arc<dyn CoverField>, Vec<u8>);

/// What grows, by the best source that there is: classes or a tinted map, with measured canopy
/// heights over them; else the photo by its colours; else nothing.
fn open_cover(
    file: &SceneFile,
    species: &[Species],
    growths: &mut Growths,
    place: &Place<'_>,
    colour: Option<&Arc<dyn ColourField>>,
    height: &Arc<RasterHeight>,
    facts: &mut Vec<(&'static str, String)>,
) -> Result<Option<Below>, UserError> {
    let rules = growths.rules();
    let mut classes: Option<Below> = None;
    if let Some(map) = &file.topographic_map {
        let options = options(&map.crs, None);
        let class = ClassSetting { species: map.species.clone(), ..ClassSetting::default() };
        let named = growth_of(growths, species, &class)
            .map_err(|error| UserError::new(format!("topographic_map.{error}")))?;
        let growth = if map.species.is_some() { named } else { rules.mixed };
        let key = MapKey { forest: map.forest.clone(), water: map.water.clone(), tolerance: map.tolerance };
        let opened = open_topographic_map(&map.path, &options, &key, growth)?;
        place.check_touches(&map.path, opened.extent())?;
        facts.push(("topographic map", open_colour(&map.path, &options)?.describe().to_string()));
        classes = Some((opened, vec![growth]));
    }
    if let Some(source) = &file.land_cover {
        let table = class_table(source, species, growths)?;
        let opened = open_land_cover(&source.path, &options(&source.crs, source.nodata), &table, &rules)?;
        place.check_touches(&source.path, opened.extent())?;
        let description = format!("{}\n  classes     {}", opened.source().describe(), opened.table_name());
        facts.push(("land cover", description));
        let grown = opened.growths();
        classes = Some((opened, grown));
    }
    let below = classes.or_else(|| {
        colour.map(|colour| {
            let height = height.clone() as Arc<dyn HeightField>;
            let grown = vec![rules.conifer, rules.broadleaf, rules.mixed];
            (photo_cover(colour.clone(), height, rules), grown)
        })
    });
    let Some(source) = &file.canopy_height else { return Ok(below) };
    let canopy =
        open_canopy_height(&source.path, &options(&source.crs, source.nodata), source.scale, rules.mixed)?;
    place.check_touches(&source.path, canopy.extent())?;
    facts.push(("canopy height", canopy.source().describe().to_string()));
    Ok(Some(match below {
        Some((below, mut grown)) => {
            grown.push(rules.mixed);
            (Arc::new(LayeredCover::new(below, canopy)), grown)
        }
        None => (canopy, vec![rules.mixed]),
    }))
}

fn options(crs: &Option<String>, nodata: Option<f64>) -> SourceOptions {
    SourceOptions { assume_crs: crs.clone(), nodata }
}

/// The class table of a scene file as cover by value; empty where it gives none.
fn class_table(
    source: &LandCoverSource,
    species: &[Species],
    growths: &mut Growths,
) -> Result<BTreeMap<i64, Cover>, UserError> {
    let wrong = |value: &str, error: String| UserError::new(format!("land_cover.classes.{value}.{error}"));
    source
        .classes
        .iter()
        .map(|(value, class)| {
            let number = value.parse().map_err(|_| wrong(value, "it is no whole number".to_owned()))?;
            let code = growth_of(growths, species, class).map_err(|error| wrong(value, error))?;
            let closure = class.closure.unwrap_or(if code == 0 { 0.0 } else { 1.0 });
            let cover = Cover {
                species: code,
                closure: (255.0 * closure).round() as u8,
                height: (class.height.unwrap_or(0.0) / f64::from(CANOPY_QUANTUM_METRES)).round() as u8,
                surface: class.surface.unwrap_or_default() as u8,
            };
            Ok((number, cover))
        })
        .collect()
}

/// What the sources and the scene say, each line once.
fn attribution(file: &SceneFile) -> Vec<String> {
    let sources = [
        file.dem.as_ref().and_then(|source| source.attribution.as_ref()),
        file.photo.as_ref().and_then(|source| source.attribution.as_ref()),
        file.land_cover.as_ref().and_then(|source| source.attribution.as_ref()),
        file.canopy_height.as_ref().and_then(|source| source.attribution.as_ref()),
        file.topographic_map.as_ref().and_then(|source| source.attribution.as_ref()),
    ];
    let mut lines: Vec<String> = Vec::new();
    for line in sources.into_iter().flatten().chain(&file.attribution) {
        if !lines.contains(line) {
            lines.push(line.clone());
        }
    }
    lines
}

fn name_of(path: &Path) -> String {
    path.file_stem().map_or_else(|| "Scene".to_owned(), |name| name.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene_file::ClassSetting;
    use treeline_core::sun::{SunPosition, unix_seconds_from_rfc3339};

    #[test]
    fn classes_become_cover() {
        let species = Species::built_in();
        let class = |text: &str| toml::from_str::<ClassSetting>(text).unwrap();
        let source = LandCoverSource {
            classes: [
                ("41".to_owned(), class("species = 'beech'\nclosure = 0.5\nheight = 20")),
                ("42".to_owned(), class("species = 'Norway spruce'")),
                ("-3".to_owned(), class("surface = 'water'")),
            ]
            .into(),
            ..LandCoverSource::default()
        };
        let table = class_table(&source, &species, &mut Growths::new(&species)).unwrap();
        assert_eq!(table[&41], Cover { species: 2, closure: 128, height: 80, surface: 0 });
        assert_eq!(table[&42], Cover { species: 1, closure: 255, height: 0, surface: 0 });
        assert_eq!(table[&-3], Cover { species: 0, closure: 0, height: 0, surface: 2 });
    }

    #[test]
    fn attributions_once_each() {
        let file: SceneFile = toml::from_str(
            "attribution = ['c', 'a']\n[dem]\npath = 'd'\nattribution = 'a'\n[photo]\npath = 'p'\nattribution = 'b'",
        )
        .unwrap();
        assert_eq!(attribution(&file), ["a", "b", "c"]);
    }

    #[test]
    fn the_default_sun_is_well_up_everywhere_that_has_days() {
        for longitude in [-180.0, -114.0, 0.0, 8.3, 114.2, 179.9, 181.0] {
            for latitude in [-54.0, -33.9, 0.0, 22.0, 46.6, 61.5] {
                let bounds =
                    GeographicBox { west: longitude, south: latitude, east: longitude, north: latitude };
                let time = unix_seconds_from_rfc3339(&default_sun_time(&bounds)).unwrap();
                let up = SunPosition::at(time, longitude, latitude).direction_enu();
                assert!(up.z > 0.45 && up.x > 0.3, "{longitude} {latitude}: {up}");
            }
        }
    }
}
