//! The command line.

use crate::error::ShotError;
use crate::output;
use clap::{Parser, ValueEnum};
use std::path::PathBuf;
use treeline_client::headless::AdapterChoice;
use treeline_client::passes::compress_photo::PhotoCompression;
use treeline_client::stream::SurfaceChoice;
use treeline_client::stream::tile_choice::TileChoice;
use treeline_client::stream::tree_field::FARTHEST_METRES;
use treeline_client::stream::undergrowth::FARTHEST_UNDERGROWTH_METRES;
use treeline_core::seeds::season::NamedSeason;
use treeline_core::sun::unix_seconds_from_rfc3339;
use treeline_server::cli::SceneArguments;
use treeline_shaders::weather::STRONGEST_WIND;

/// Draws one picture of a scene or of a height field, without a browser. Without a source: the
/// built-in landscape.
#[derive(Debug, Parser)]
#[command(name = "treeline-shot", version)]
pub struct Arguments {
    /// The scene.
    #[command(flatten)]
    pub scene: SceneArguments,
    /// A running Treeline server in place of a scene.
    #[arg(long, value_name = "URL")]
    pub server: Option<String>,
    /// A grid of heights in place of a scene: 2-D float32 or float64 .npy, metres, row 0 is north.
    #[arg(long, value_name = "GRID.NPY")]
    pub heightfield: Option<PathBuf>,
    /// Distance between samples of the height field, metres.
    #[arg(long, value_name = "METRES", allow_hyphen_values = true, value_parser = metres)]
    pub cell_size: Option<f64>,
    /// Place of the height field's south-west sample, metres. [default: 0,0]
    #[arg(long, value_name = "X,Y", allow_hyphen_values = true, value_parser = pair)]
    pub origin: Option<[f64; 2]>,
    /// Bend the height field: the surface at distance d from the eye lies d²/2R lower.
    #[arg(long, value_name = "METRES", allow_hyphen_values = true, value_parser = metres)]
    pub earth_radius: Option<f64>,
    /// Who looks: JSON. [default for scenes: the scene's own view]
    #[arg(long, value_name = "CAMERA.JSON")]
    pub camera: Option<PathBuf>,
    /// Picture, pixels.
    #[arg(long, value_name = "WIDTHxHEIGHT", allow_hyphen_values = true, value_parser = size)]
    pub size: [u32; 2],
    /// Write the picture (PNG, or JPEG by the file's ending).
    #[arg(long, value_name = "OUT.PNG")]
    pub color: Option<PathBuf>,
    /// Write distances from the eye: float32 .npy, +inf for a miss.
    #[arg(long, value_name = "OUT.NPY")]
    pub depth: Option<PathBuf>,
    /// Write the trees that were selected.
    #[arg(long, value_name = "OUT.CSV")]
    pub trees: Option<PathBuf>,
    /// Write statistics.
    #[arg(long, value_name = "OUT.JSON")]
    pub stats: Option<PathBuf>,
    /// Which surface a scene shows.
    #[arg(long, value_enum, default_value_t = Surface::Combined)]
    pub surface: Surface,
    /// How rays meet the surface.
    #[arg(long, value_name = "NAME", default_value = "max-mip", value_parser = intersector)]
    pub intersector: String,
    /// Bound of the intersector's steps, for those that take one (max-mip is exact and takes none).
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = whole::<1, { u32::MAX }>)]
    pub steps: Option<u32>,
    /// Steps of the march toward the sun; 0 for no shadows.
    #[arg(long, value_name = "N", default_value_t = treeline_client::engine::DEFAULT_SHADOW_STEPS, allow_hyphen_values = true, value_parser = whole::<0, 1000>)]
    pub shadow_steps: u32,
    /// Date and time of the sun and of the seasons, as in 2026-10-15T14:00:00Z. [default: the scene's]
    #[arg(long, value_name = "TIME", value_parser = time, conflicts_with = "season")]
    pub time: Option<f64>,
    /// The season by name in place of a date: spring, summer, autumn or winter, at the scene's time of day.
    #[arg(long, value_name = "NAME", value_parser = season)]
    pub season: Option<NamedSeason>,
    /// Speed of the wind, m/s, 20 at most; trees sway, and gusts run over the canopy.
    #[arg(long, value_name = "M_PER_S", default_value_t = 0.0, allow_hyphen_values = true, value_parser = wind)]
    pub wind: f64,
    /// For how long the wind has blown, seconds: a picture of the same moment is the same.
    #[arg(long, value_name = "SECONDS", default_value_t = 12.5, allow_hyphen_values = true, value_parser = seconds)]
    pub wind_seconds: f64,
    /// Share of the sky under clouds, whose shadows lie on the land, 0 to 1.
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, allow_hyphen_values = true, value_parser = share)]
    pub clouds: f64,
    /// Up to which distance trees are drawn one by one, metres, 1400 at most; 0 for none. [default: 1000, on
    /// adapters that run on the processor 400]
    #[arg(long, value_name = "METRES", allow_hyphen_values = true, value_parser = distance)]
    pub tree_distance: Option<f64>,
    /// Up to which distance grass, flowers, ferns, stones and dead wood are drawn, metres, 120 at most; 0 for none.
    /// [default: 80, on adapters that run on the processor 60]
    #[arg(long, value_name = "METRES", allow_hyphen_values = true, value_parser = undergrowth)]
    pub undergrowth: Option<f64>,
    /// What chooses the tiles.
    #[arg(long, value_name = "NAME", default_value = "load-map", value_parser = tile_choice)]
    pub tile_choice: TileChoice,
    /// How the GPU holds photo tiles: plain, compressed (where the adapter can), or auto (on a real GPU).
    #[arg(long, value_name = "NAME", default_value = "plain", value_parser = photo_tiles)]
    pub photo_tiles: PhotoCompression,
    /// Which Vulkan adapter draws.
    #[arg(long, value_enum, default_value_t = Adapter::Any)]
    pub adapter: Adapter,
    /// Draw so many times; times are medians.
    #[arg(long, value_name = "N", default_value_t = 1, allow_hyphen_values = true, value_parser = whole::<1, 10_000>)]
    pub repeat: u32,
}

/// `--surface`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Surface {
    /// Terrain and canopy.
    Combined,
    /// Bare terrain.
    Elevation,
}

impl From<Surface> for SurfaceChoice {
    fn from(surface: Surface) -> Self {
        match surface {
            Surface::Combined => Self::Combined,
            Surface::Elevation => Self::Elevation,
        }
    }
}

/// `--adapter`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Adapter {
    /// One that runs on the CPU: the same picture on every machine.
    Software,
    /// The fastest that there is.
    Any,
}

impl From<Adapter> for AdapterChoice {
    fn from(adapter: Adapter) -> Self {
        match adapter {
            Adapter::Software => Self::Software,
            Adapter::Any => Self::Any,
        }
    }
}

impl Arguments {
    /// What clap cannot check: flags that do not go together.
    pub fn check(&self) -> Result<(), ShotError> {
        let scene = &self.scene;
        let from_files = scene.scene.is_some()
            || scene.dem.is_some()
            || scene.photo.is_some()
            || scene.land_cover.is_some()
            || scene.canopy_height.is_some()
            || scene.topographic_map.is_some()
            || scene.assume_crs.is_some()
            || scene.nodata.is_some();
        let sources = [
            ("--scene, --dem and their like", from_files),
            ("--server", self.server.is_some()),
            ("--heightfield", self.heightfield.is_some()),
        ];
        let given: Vec<&str> = sources.iter().filter(|(_, given)| *given).map(|(name, _)| *name).collect();
        if given.len() > 1 {
            return Err(ShotError::input(format!("{} exclude each other; give one", given.join(" and "))));
        }
        if self.heightfield.is_none() {
            let planar = [
                ("--cell-size", self.cell_size.is_some()),
                ("--origin", self.origin.is_some()),
                ("--earth-radius", self.earth_radius.is_some()),
            ];
            if let Some((flag, _)) = planar.iter().find(|(_, given)| *given) {
                return Err(ShotError::input(format!(
                    "{flag} belongs to --heightfield; leave it out for a scene"
                )));
            }
        } else {
            self.check_height_field()?;
        }
        let outputs = [
            ("--color", &self.color),
            ("--depth", &self.depth),
            ("--trees", &self.trees),
            ("--stats", &self.stats),
        ];
        if outputs.iter().all(|(_, path)| path.is_none()) {
            return Err(ShotError::input(
                "nothing to write; give --color, --depth, --trees or --stats a file",
            ));
        }
        for (flag, path) in outputs {
            if let Some(path) = path {
                output::check_folder(flag, path)?;
            }
        }
        let given: Vec<_> = outputs.iter().filter_map(|(flag, path)| Some((flag, path.as_ref()?))).collect();
        for (index, (flag, path)) in given.iter().enumerate() {
            if let Some((first, _)) = given[..index].iter().find(|(_, known)| known == path) {
                return Err(ShotError::input(format!(
                    "{first} and {flag} name the same file, {}; give each its own",
                    path.display()
                )));
            }
        }
        self.color.as_deref().map_or(Ok(()), output::check_picture)
    }

    fn check_height_field(&self) -> Result<(), ShotError> {
        if self.cell_size.is_none() {
            return Err(ShotError::input(
                "--heightfield needs --cell-size METRES, the distance between samples",
            ));
        }
        if self.trees.is_some() {
            return Err(ShotError::input("--trees: nothing grows on a height field; leave the flag out"));
        }
        if self.time.is_some() || self.season.is_some() || self.wind > 0.0 || self.clouds > 0.0 {
            return Err(ShotError::input(
                "--time, --season, --wind and --clouds: a height field has no sun and no weather; leave them out",
            ));
        }
        if self.camera.is_none() {
            return Err(ShotError::input("--heightfield needs --camera CAMERA.JSON with eye and target"));
        }
        Ok(())
    }
}

/// A whole number from `LEAST` to `GREATEST`.
fn whole<const LEAST: u32, const GREATEST: u32>(text: &str) -> Result<u32, String> {
    let number = text.trim().parse().ok().filter(|number| (LEAST..=GREATEST).contains(number));
    number.ok_or_else(|| format!("it must be a whole number from {LEAST} to {GREATEST}"))
}

/// A length.
fn metres(text: &str) -> Result<f64, String> {
    let number = text.trim().parse::<f64>().ok().filter(|number| number.is_finite() && *number > 0.0);
    number.ok_or_else(|| "it must be a length in metres, more than 0, as in 1.7".into())
}

/// A length, or none.
fn distance(text: &str) -> Result<f64, String> {
    between(text, [0.0, FARTHEST_METRES], "a length in metres")
}

fn undergrowth(text: &str) -> Result<f64, String> {
    between(text, [0.0, FARTHEST_UNDERGROWTH_METRES], "a length in metres")
}

/// A number between two ends, both included.
fn between(text: &str, ends: [f64; 2], what: &str) -> Result<f64, String> {
    let number = text.trim().parse::<f64>().ok().filter(|number| (ends[0]..=ends[1]).contains(number));
    number.ok_or_else(|| format!("it must be {what}, {} to {}", ends[0], ends[1]))
}

fn wind(text: &str) -> Result<f64, String> {
    between(text, [0.0, STRONGEST_WIND], "a speed in metres a second")
}

fn seconds(text: &str) -> Result<f64, String> {
    between(text, [0.0, 86_400.0], "seconds")
}

fn share(text: &str) -> Result<f64, String> {
    between(text, [0.0, 1.0], "a share")
}

/// A time, as seconds since 1970.
fn time(text: &str) -> Result<f64, String> {
    unix_seconds_from_rfc3339(text).map_err(|error| error.to_string())
}

fn season(text: &str) -> Result<NamedSeason, String> {
    let names = NamedSeason::ALL.map(|(name, ..)| name).join(", ");
    NamedSeason::from_name(text).ok_or_else(|| format!("there is no such season; they are {names}"))
}

fn pair(text: &str) -> Result<[f64; 2], String> {
    let numbers: Option<Vec<f64>> = text
        .split(',')
        .map(|part| part.trim().parse::<f64>().ok().filter(|value| value.is_finite()))
        .collect();
    match numbers.as_deref() {
        Some(&[x, y]) => Ok([x, y]),
        _ => Err("it must be two numbers, as in 0,-1500.5".into()),
    }
}

fn size(text: &str) -> Result<[u32; 2], String> {
    let sides = text
        .split_once(['x', 'X'])
        .and_then(|(width, height)| Some([width.parse::<u32>().ok()?, height.parse::<u32>().ok()?]));
    match sides {
        Some(sides) if sides.iter().all(|side| (1..=16_384).contains(side)) => Ok(sides),
        _ => Err("it must be width and height in pixels, 1 to 16384 each, as in 640x512".into()),
    }
}

fn intersector(text: &str) -> Result<String, String> {
    match text {
        "max-mip" => Ok(text.into()),
        "linear" | "linear-binary" | "safety-zones" | "cone-step" => {
            Err("this version has no such intersector yet; it has max-mip".into())
        }
        _ => Err("there is no such intersector; this version has max-mip".into()),
    }
}

fn tile_choice(text: &str) -> Result<TileChoice, String> {
    match text {
        "load-map" => Ok(TileChoice::LoadMap),
        "cpu" => Ok(TileChoice::Cpu),
        _ => Err("there is no such choice; write load-map or cpu".into()),
    }
}

fn photo_tiles(text: &str) -> Result<PhotoCompression, String> {
    match text {
        "auto" => Ok(PhotoCompression::Automatic),
        "plain" => Ok(PhotoCompression::Plain),
        "compressed" => Ok(PhotoCompression::Compressed),
        _ => Err("there is no such choice; write auto, plain or compressed".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(line: &str) -> Result<Arguments, String> {
        Arguments::try_parse_from(line.split_whitespace()).map_err(|error| error.to_string())
    }

    #[test]
    fn negative_numbers_everywhere() {
        let arguments = parse("shot --heightfield g.npy --cell-size 1.7 --origin -100,-2.5 --camera c.json --size 640x512 --depth d.npy").unwrap();
        assert_eq!(arguments.origin, Some([-100.0, -2.5]));
        assert_eq!(arguments.size, [640, 512]);
        assert_eq!(arguments.check(), Ok(()));
        let arguments = parse("shot --dem d.tif --nodata -9999 --size 6x5 --color o.png").unwrap();
        assert_eq!(arguments.scene.nodata, Some(-9999.0));
    }

    #[test]
    fn what_does_not_exist_yet_says_what_does() {
        for (flag, has) in [
            ("--intersector cone-step", "max-mip"),
            ("--tile-choice gpu", "load-map or cpu"),
            ("--photo-tiles bc1", "plain or compressed"),
        ] {
            assert!(parse(&format!("shot --size 6x5 --color o.png {flag}")).unwrap_err().contains(has));
        }
        let trees = parse("shot --size 6x5 --trees o.csv --tree-distance 0").unwrap();
        assert_eq!((trees.check(), trees.tree_distance), (Ok(()), Some(0.0)));
    }

    #[test]
    fn wrong_flags_are_named() {
        for (line, word) in [
            ("shot --size 0x5 --color o.png", "--size"),
            ("shot --size 640 --color o.png", "--size"),
            ("shot --size 6x5 --colour o.png", "--colour"),
            ("shot --size 6x5 --color o.png --origin 1", "--origin"),
            ("shot --size -6x5 --color o.png", "--size"),
            ("shot --size 6x5 --color o.png --repeat 0", "1 to 10000"),
            ("shot --size 6x5 --color o.png --tree-distance -1", "0 to 1400"),
            ("shot --size 6x5 --color o.png --undergrowth 500", "0 to 120"),
            ("shot --size 6x5 --color o.png --steps -1", "--steps"),
            ("shot --size 6x5 --color o.png --wind 90", "0 to 20"),
            ("shot --size 6x5 --color o.png --clouds nan", "0 to 1"),
            ("shot --size 6x5 --color o.png --time noon", "2026-07-15T09:00:00Z"),
            ("shot --size 6x5 --color o.png --season fall", "spring, summer, autumn, winter"),
            ("shot --size 6x5 --color o.png --season winter --time 2026-01-01T09:00:00Z", "--time"),
            ("shot --size 6x5 --color o.png --shadow-steps x", "0 to 1000"),
            ("shot --size 6x5 --color o.png --cell-size nan", "--cell-size"),
            ("shot --size 6x5 --color o.png --earth-radius -5", "more than 0"),
        ] {
            assert!(parse(line).unwrap_err().contains(word), "{line}");
        }
        for (line, word) in [
            ("shot --size 6x5", "nothing to write"),
            ("shot --size 6x5 --depth o --stats o", "the same file"),
            ("shot --size 6x5 --color o.png --cell-size 2", "--cell-size"),
            ("shot --size 6x5 --color o.png --heightfield g.npy", "--cell-size"),
            ("shot --size 6x5 --color o.png --heightfield g.npy --cell-size 2", "--camera"),
            ("shot --size 6x5 --color o.png --server http://h --dem d.tif", "exclude"),
        ] {
            assert!(parse(line).unwrap().check().unwrap_err().to_string().contains(word), "{line}");
        }
    }
}
