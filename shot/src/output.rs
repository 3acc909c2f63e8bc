//! Files, written whole or not at all.

use crate::error::ShotError;
use image::ImageEncoder as _;
use std::io::Write as _;
use std::path::Path;

/// Quality of JPEG pictures.
const JPEG_QUALITY: u8 = 92;

/// Writes beside the file, then takes its place.
pub fn write(flag: &str, path: &Path, bytes: &[u8]) -> Result<(), ShotError> {
    // What a link points to is replaced, not the link.
    let target = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
    let folder = folder_of(&target);
    let problem = |error: std::io::Error| {
        ShotError::input(format!(
            "{flag} {}: cannot be written ({}); name a file in a folder that this user may write",
            path.display(),
            error.kind()
        ))
    };
    let mut builder = tempfile::Builder::new();
    // As other programs make files, not readable by the owner alone.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        builder.permissions(std::fs::Permissions::from_mode(0o644));
    }
    let mut file = builder.prefix(".treeline-shot").tempfile_in(folder).map_err(problem)?;
    file.write_all(bytes).and_then(|()| file.as_file().sync_all()).map_err(problem)?;
    file.persist(&target).map_err(|error| problem(error.error))?;
    Ok(())
}

/// Checks before any work that there is a folder for the file, and nothing in its place but a file.
pub fn check_folder(flag: &str, path: &Path) -> Result<(), ShotError> {
    let problem = match std::fs::metadata(path) {
        Ok(found) if found.is_dir() => "it is a folder; name a file",
        // A device or a pipe would be replaced by a file, whole: nobody wants /dev/null to be one.
        Ok(found) if !found.is_file() => "it is no regular file; name a file",
        Ok(_) => return Ok(()),
        Err(_) if folder_of(path).is_dir() => return Ok(()),
        Err(_) => "there is no such folder; make it first",
    };
    Err(ShotError::input(format!("{flag} {}: {problem}", path.display())))
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Checks before any work that a picture's format is known.
pub fn check_picture(path: &Path) -> Result<(), ShotError> {
    if is_png(path) || is_jpeg(path) {
        return Ok(());
    }
    Err(ShotError::input(format!("--color {}: end the name with .png or .jpg", path.display())))
}

fn ending(path: &Path) -> String {
    path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default()
}

fn is_png(path: &Path) -> bool {
    ending(path) == "png"
}

fn is_jpeg(path: &Path) -> bool {
    matches!(ending(path).as_str(), "jpg" | "jpeg")
}

/// Writes a picture; its alpha is left out.
pub fn picture(path: &Path, width: u32, height: u32, rgba: &[u8]) -> Result<(), ShotError> {
    let rgb: Vec<u8> = rgba.chunks_exact(4).flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
    let mut bytes = Vec::new();
    let colour = image::ExtendedColorType::Rgb8;
    let encoded = if is_jpeg(path) {
        image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY)
            .write_image(&rgb, width, height, colour)
    } else {
        image::codecs::png::PngEncoder::new(&mut bytes).write_image(&rgb, width, height, colour)
    };
    encoded.map_err(|error| ShotError::failure(format!("--color {}: {error}", path.display())))?;
    write("--color", path, &bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_replaced_whole_and_nothing_is_left_behind() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        std::fs::write(&path, b"old").unwrap();
        picture(&path, 2, 1, &[255, 0, 0, 255, 0, 255, 0, 255]).unwrap();
        let read = image::open(&path).unwrap().into_rgb8();
        assert_eq!(read.as_raw(), &[255, 0, 0, 0, 255, 0]);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        let error = write("--stats", &folder.path().join("no/where.json"), b"").unwrap_err();
        assert!(error.to_string().starts_with("--stats "));
        assert!(check_picture(Path::new("a.gif")).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn devices_are_left_alone_and_links_are_followed() {
        let error = check_folder("--depth", Path::new("/dev/null")).unwrap_err();
        assert_eq!(error.to_string(), "--depth /dev/null: it is no regular file; name a file");
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("file"), folder.path().join("link"));
        std::fs::write(&file, b"old").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        check_folder("--stats", &link).unwrap();
        write("--stats", &link, b"new").unwrap();
        assert_eq!(std::fs::read(&file).unwrap(), b"new");
        assert!(std::fs::symlink_metadata(&link).unwrap().is_symlink());
    }
}
