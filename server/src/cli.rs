//! The command line.

use crate::scene_file::{
    CanopyHeightSource, DemSource, LandCoverSource, PhotoSource, SceneFile, TopographicMapSource,
};
use crate::source::crs::parse_epsg;
use crate::user_error::UserError;
use clap::error::ErrorKind;
use clap::{Args, Parser, Subcommand};
use std::ops::RangeInclusive;
use std::path::PathBuf;
use treeline_core::layer::{LAYERS, Layer};
use treeline_core::tile::{GeographicBox, MAXIMUM_LEVEL};

/// Treeline shows real landscapes with their forests: a tile server and the page that draws them.
#[derive(Debug, Parser)]
#[command(name = "treeline", version, disable_help_subcommand = true)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Serve a scene: the page, its tiles, and WMS. Without any flag, the built-in landscape.
    Serve(ServeArguments),
    /// Open every source and print what it is, or the first thing that is wrong.
    Check(ServeArguments),
    /// Fill the folder of --cache with tiles; can be stopped and started again.
    Seed(SeedArguments),
    /// Ask a running server whether it is ready: exit code 0, or 1 and why not.
    Health(HealthArguments),
}

/// Whom to ask.
#[derive(Clone, Debug, Args)]
pub struct HealthArguments {
    /// Where the server is.
    #[arg(default_value = "http://127.0.0.1:8080", value_parser = crate::config::public_url)]
    pub url: String,
}

/// Which scene.
#[derive(Clone, Debug, Default, Args)]
pub struct SceneArguments {
    /// Scene file; the flags below change it.
    #[arg(long, value_name = "SCENE.TOML")]
    pub scene: Option<PathBuf>,
    /// Terrain: a GeoTIFF of heights.
    #[arg(long, value_name = "FILE")]
    pub dem: Option<PathBuf>,
    /// Aerial photo: a GeoTIFF.
    #[arg(long, value_name = "FILE")]
    pub photo: Option<PathBuf>,
    /// Land-cover classes: a GeoTIFF.
    #[arg(long, value_name = "FILE")]
    pub land_cover: Option<PathBuf>,
    /// Height of the canopy over the ground, metres: a GeoTIFF.
    #[arg(long, value_name = "FILE")]
    pub canopy_height: Option<PathBuf>,
    /// Topographic map whose green tint says where forest is: a GeoTIFF.
    #[arg(long, value_name = "FILE")]
    pub topographic_map: Option<PathBuf>,
    /// CRS of the --dem, in place of what the file says.
    #[arg(long, value_name = "EPSG:N", value_parser = epsg_text)]
    pub assume_crs: Option<String>,
    /// Value that stands for no data in the --dem.
    #[arg(long, value_name = "NUMBER", allow_hyphen_values = true, value_parser = any_number)]
    pub nodata: Option<f64>,
}

/// How to serve.
#[derive(Clone, Debug, Default, Args)]
pub struct ServeArguments {
    /// Which scene.
    #[command(flatten)]
    pub scene: SceneArguments,
    /// URL under which people reach the server, for links in documents.
    #[arg(long, value_name = "URL", value_parser = crate::config::public_url)]
    pub public_url: Option<String>,
    /// Address and port; port 0 picks one. [default: 127.0.0.1:8080]
    #[arg(long, value_name = "ADDRESS:PORT", value_parser = crate::config::listen_address)]
    pub listen: Option<String>,
    /// Folder for tiles that outlive the process.
    #[arg(long, value_name = "FOLDER")]
    pub cache: Option<PathBuf>,
    /// Settings of the server.
    #[arg(long, value_name = "TREELINE.TOML")]
    pub config: Option<PathBuf>,
}

/// What to make beforehand.
#[derive(Clone, Debug, Args)]
pub struct SeedArguments {
    /// Which scene, and where the cache is.
    #[command(flatten)]
    pub serve: ServeArguments,
    /// Box in degrees: west,south,east,north.
    #[arg(long, value_name = "W,S,E,N", allow_hyphen_values = true, value_parser = bounding_box)]
    pub bbox: GeographicBox,
    /// Matrix levels, both included.
    #[arg(long, value_name = "A..B", allow_hyphen_values = true, value_parser = levels)]
    pub levels: RangeInclusive<u8>,
    /// Layers, separated by commas. [default: all that the scene has]
    #[arg(long, value_name = "LAYERS", value_delimiter = ',', value_parser = layer)]
    pub layers: Vec<Layer>,
}

impl SceneArguments {
    /// The scene that the flags describe; `None` is the built-in one.
    pub fn scene_file(&self) -> Result<Option<SceneFile>, UserError> {
        let base = match &self.scene {
            Some(path) => Some(SceneFile::read(path)?),
            None => None,
        };
        let Some(mut scene) = base.or_else(|| self.dem.is_some().then(SceneFile::default)) else {
            let given = [
                ("--photo", self.photo.is_some()),
                ("--land-cover", self.land_cover.is_some()),
                ("--canopy-height", self.canopy_height.is_some()),
                ("--topographic-map", self.topographic_map.is_some()),
                ("--assume-crs", self.assume_crs.is_some()),
                ("--nodata", self.nodata.is_some()),
            ];
            return match given.iter().find(|(_, given)| *given) {
                Some((flag, _)) => {
                    Err(UserError::new(format!("{flag} needs terrain; add --dem FILE or --scene FILE")))
                }
                None => Ok(None),
            };
        };
        if let Some(path) = self.dem.clone() {
            scene.dem = Some(DemSource { path, ..DemSource::default() });
        }
        if let Some(dem) = &mut scene.dem {
            dem.crs = self.assume_crs.clone().or(dem.crs.take());
            dem.nodata = self.nodata.or(dem.nodata);
        }
        if let Some(path) = self.photo.clone() {
            scene.photo = Some(PhotoSource { path, ..PhotoSource::default() });
        }
        if let Some(path) = self.land_cover.clone() {
            scene.land_cover = Some(LandCoverSource { path, ..LandCoverSource::default() });
        }
        if let Some(path) = self.canopy_height.clone() {
            scene.canopy_height = Some(CanopyHeightSource { path, ..CanopyHeightSource::default() });
        }
        if let Some(path) = self.topographic_map.clone() {
            scene.topographic_map = Some(TopographicMapSource { path, ..TopographicMapSource::default() });
        }
        Ok(Some(scene))
    }
}

/// Clap's complaint as one line that ends with the way to help.
pub fn one_line(error: &clap::Error, program: &str) -> String {
    if error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        return format!("there is no command; `{program} --help` lists them");
    }
    let text = error.render().to_string();
    let mut parts = Vec::new();
    for line in text.lines().map(str::trim) {
        if line.starts_with("Usage:") || line.starts_with("For more information") {
            continue;
        }
        parts.push(line.strip_prefix("error: ").or_else(|| line.strip_prefix("tip: ")).unwrap_or(line));
    }
    let line = parts.iter().filter(|part| !part.is_empty()).copied().collect::<Vec<_>>().join("; ");
    format!("{}; `{program} --help` lists the flags", line.replace(":;", ":"))
}

/// A number, NaN and the infinities included: they occur as values that stand for no data.
pub fn any_number(text: &str) -> Result<f64, String> {
    text.trim().parse().map_err(|_| "it is no number; write for example -9999 or nan".to_owned())
}

fn epsg_text(text: &str) -> Result<String, String> {
    parse_epsg(text).map(|code| format!("EPSG:{code}")).map_err(|error| error.to_string())
}

fn bounding_box(text: &str) -> Result<GeographicBox, String> {
    let numbers: Vec<f64> = text
        .split(',')
        .map(|part| part.trim().parse::<f64>().ok().filter(|value| value.is_finite()))
        .collect::<Option<_>>()
        .ok_or("it must be four numbers: west,south,east,north in degrees")?;
    let &[west, south, east, north] = numbers.as_slice() else {
        return Err(format!("it holds {} numbers; it must be four: west,south,east,north", numbers.len()));
    };
    if south < -90.0 || north > 90.0 || south >= north {
        return Err(
            "south must be less than north, both within 90 degrees; the order is west,south,east,north"
                .to_owned(),
        );
    }
    if !(-360.0..=360.0).contains(&west) || !(-360.0..=720.0).contains(&east) {
        return Err(
            "west and east must lie within 360 degrees; the order is west,south,east,north".to_owned()
        );
    }
    // West greater than east: across the antimeridian.
    let east = if east <= west { east + 360.0 } else { east };
    if east <= west || east - west > 360.0 {
        return Err("west and east must span at most one turn; the order is west,south,east,north".to_owned());
    }
    Ok(GeographicBox { west, south, east, north })
}

fn levels(text: &str) -> Result<RangeInclusive<u8>, String> {
    let (first, last) =
        text.split_once("..").map_or((text, text), |(first, last)| (first, last.trim_start_matches('=')));
    let level = |text: &str| text.trim().parse::<u8>().ok().filter(|level| *level <= MAXIMUM_LEVEL);
    match (level(first), level(last)) {
        (Some(first), Some(last)) if first <= last => Ok(first..=last),
        _ => Err(format!(
            "write for example 6..12, from 0 to {MAXIMUM_LEVEL}, the smaller first (both are made)"
        )),
    }
}

fn layer(text: &str) -> Result<Layer, String> {
    let names = LAYERS.map(|row| row.name);
    Layer::from_name(text.trim()).ok_or_else(|| format!("there are the layers {}", names.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory as _;

    fn parse(line: &str) -> Result<Cli, String> {
        Cli::try_parse_from(line.split(' ')).map_err(|error| one_line(&error, "treeline serve"))
    }

    #[test]
    fn the_definition_is_sound() {
        Cli::command().debug_assert();
    }

    #[test]
    fn numbers_may_be_negative() {
        let Command::Seed(seed) =
            parse("treeline seed --bbox -122.5,-10,-122,-9 --levels 3..5 --nodata -9999 --dem a")
                .unwrap()
                .command
        else {
            panic!()
        };
        assert_eq!(seed.bbox.west, -122.5);
        assert_eq!(seed.levels, 3..=5);
        assert_eq!(seed.serve.scene.nodata, Some(-9999.0));
        let Command::Seed(seed) = parse("treeline seed --bbox=170,-20,-170,-10 --levels 4").unwrap().command
        else {
            panic!()
        };
        assert_eq!((seed.bbox.east, seed.levels), (190.0, 4..=4));
    }

    #[test]
    fn every_wrong_flag_is_one_line_that_names_it() {
        for (line, named) in [
            ("treeline serve --dme a.tif", "'--dme'"),
            ("treeline serve --nodata none", "write for example -9999"),
            ("treeline seed --bbox 1,2,3,4 --levels -1..3", "--levels"),
            ("treeline serve --assume-crs 4326", "EPSG:32632"),
            ("treeline serve --public-url example.org", "http://"),
            ("treeline seed --levels 3..5", "--bbox"),
            ("treeline seed --bbox 1,2,3 --levels 3", "four"),
            ("treeline seed --bbox 1,3,2,2 --levels 3", "south must be less"),
            ("treeline seed --bbox 1,2,3,nan --levels 3", "--bbox"),
            ("treeline seed --bbox 1,2,3,4 --levels 5..3", "the smaller first"),
            ("treeline seed --bbox 1,2,3,4 --levels 5 --layers photo", "texture"),
            ("treeline sevre", "sevre"),
            ("treeline", "there is no command"),
        ] {
            let error = parse(line).unwrap_err();
            assert!(error.contains(named) && !error.contains('\n'), "{line}: {error}");
        }
    }

    #[test]
    fn flags_make_a_scene() {
        let scene = |line: &str| {
            let Command::Serve(arguments) = parse(line).unwrap().command else { panic!() };
            arguments.scene.scene_file()
        };
        assert_eq!(scene("treeline serve"), Ok(None));
        let full = scene("treeline serve --dem d.tif --photo p.tif --assume-crs epsg:2056 --nodata -1")
            .unwrap()
            .unwrap();
        let dem = full.dem.unwrap();
        assert_eq!((dem.crs.as_deref(), dem.nodata), (Some("EPSG:2056"), Some(-1.0)));
        assert_eq!(full.photo.unwrap().path, PathBuf::from("p.tif"));
        assert!(
            scene("treeline serve --photo p.tif")
                .unwrap_err()
                .to_string()
                .starts_with("--photo needs terrain")
        );
        assert!(
            scene("treeline serve --scene /nowhere/s.toml")
                .unwrap_err()
                .to_string()
                .starts_with("/nowhere/s.toml: cannot be read")
        );
    }

    #[test]
    fn flags_change_a_scene_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.toml");
        std::fs::write(&path, "name='N'\n[dem]\npath='d.tif'\nvertical_offset=5\ncrs='EPSG:1'").unwrap();
        let arguments = SceneArguments {
            scene: Some(path),
            nodata: Some(7.0),
            photo: Some("p.tif".into()),
            ..SceneArguments::default()
        };
        let scene = arguments.scene_file().unwrap().unwrap();
        let dem = scene.dem.unwrap();
        assert_eq!(
            (dem.vertical_offset, dem.nodata, dem.crs.as_deref()),
            (Some(5.0), Some(7.0), Some("EPSG:1"))
        );
        assert_eq!(scene.name.as_deref(), Some("N"));
        assert_eq!(scene.photo.unwrap().path, PathBuf::from("p.tif"));
    }
}
