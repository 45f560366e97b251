//! What a camera file is, by its content.

use std::path::PathBuf;

use accurate_geom::{ImageSize, LengthUnit};
use accurate_io::{
    CameraFormat, IoError, NamedView, ViewDefaults, is_dicom, read_cameras, write_cameras,
};

use super::{COLMAP_CAMERAS, MM, cameras, two_views};

#[test]
fn the_two_files_of_colmap_may_have_any_names() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    let cameras = write("lenses.txt", COLMAP_CAMERAS);
    let images = write("poses.dat", "7 1 0 0 0 1 2 3 2 a.png\n");
    let size = |paths: &[PathBuf]| read_cameras(paths, &MM).map(|views| views[0].camera.size());
    let both = [images.clone(), cameras.clone()];
    assert_eq!(size(&both).unwrap(), ImageSize { width: 800, height: 600 });
    // Alone, each looks for the other by its usual name.
    let error = size(std::slice::from_ref(&cameras)).unwrap_err();
    assert!(matches!(&error, IoError::Missing { path, .. } if path.ends_with("images.txt")));
    let usual = write("cameras.txt", "2 PINHOLE 20 10 9 9 10 5\n");
    assert_eq!(size(&[images]).unwrap(), ImageSize { width: 20, height: 10 });
    let error = size(&[cameras, usual]).unwrap_err().to_string();
    assert!(error.contains("cameras.txt") && error.contains("lenses.txt"), "{error}");
}

#[test]
fn a_camera_file_is_told_by_its_content_under_any_name() {
    let folder = tempfile::tempdir().unwrap();
    let views = two_views([(512, 400), (1024, 768)]);
    let named = |name: &str| folder.path().join(name);
    for (name, format) in [
        ("c.yml", CameraFormat::OpencvYaml),
        ("c.xml", CameraFormat::OpencvXml),
        ("c.toml", CameraFormat::Rig),
        ("c.json", CameraFormat::Rig),
        ("v.json", CameraFormat::ViewsJson),
    ] {
        write_cameras(&named(name), &views, format).unwrap();
        for other in ["rig.txt", "cams.cfg", "X.TOML", "a.json", "b", "cameras.txt", "images.txt"] {
            std::fs::copy(named(name), named(other)).unwrap();
            let read = read_cameras(&[named(other)], &MM).unwrap();
            assert_eq!(cameras(&read), cameras(&views), "{name} as {other}");
        }
    }
    // A view may be called as a rig's key.
    let view = NamedView { name: "view1".into(), ..views[0].clone() };
    let text = view.to_json().unwrap().to_string();
    std::fs::write(named("one.json"), text).unwrap();
    assert_eq!(read_cameras(&[named("one.json")], &MM).unwrap()[0].name, "view1");
}

#[test]
fn every_way_to_write_a_rig_in_toml_is_known_for_one() {
    let folder = tempfile::tempdir().unwrap();
    let fields = |x: &str| {
        [
            "image_size = [512, 400]".to_owned(),
            "K = [[900, 0, 256], [0, 900, 200], [0, 0, 1]]".to_owned(),
            "R = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]".to_owned(),
            format!("t = [{x}, 0, 700]"),
        ]
    };
    let (one, two) = (fields("0"), fields("90"));
    let dotted =
        |name: &str, f: &[String]| f.iter().map(|f| format!("{name}.{f}\n")).collect::<String>();
    let tables = |a: &str, b: &str| {
        format!("unit = 'cm'\n{a}\n{}\n{b}\n{}\n", one.join("\n"), two.join("\n"))
    };
    let (inline1, inline2) = (one.join(", "), two.join(", "));
    for text in [
        tables("[view1] # left", "[view2] # right"),
        tables("  [ view1 ]", "[ \"view2\" ]"),
        tables("['view1']", "[view2]#right"),
        format!("view1 = {{ {inline1} }}\nview2 = {{ {inline2} }}\nunit = \"cm\"\n"),
        format!("\"view1\"={{{inline1}}}\nunit = \"cm\"\n[view2]\n{}", two.join("\n")),
        format!("unit = \"cm\"\n{}{}", dotted("view1", &one), dotted("view2", &two)),
    ] {
        let path = folder.path().join("rig.txt");
        std::fs::write(&path, &text).unwrap();
        let views = read_cameras(&[path], &ViewDefaults::default())
            .unwrap_or_else(|error| panic!("{error}\n{text}"));
        assert_eq!((views.len(), views[1].camera.t().x), (2, 90.0), "{text}");
        assert_eq!(views[0].unit, LengthUnit::Centimetre);
    }
    // A mistake in it is named, with its line.
    let path = folder.path().join("rig.txt");
    std::fs::write(&path, "unit = 'cm'\n[view1]\nimage_size = 5\n").unwrap();
    let error = read_cameras(&[path], &MM).unwrap_err().to_string();
    assert!(error.contains("line 3: not valid TOML rig"), "{error}");
}

#[cfg(unix)]
#[test]
fn cameras_come_through_a_pipe() {
    let folder = tempfile::tempdir().unwrap();
    let views = two_views([(512, 400), (1024, 768)]);
    for (name, format) in [
        ("c.toml", CameraFormat::Rig),
        ("c.yml", CameraFormat::OpencvYaml),
        ("c.json", CameraFormat::ViewsJson),
    ] {
        let file = folder.path().join(name);
        write_cameras(&file, &views, format).unwrap();
        let pipe = folder.path().join(format!("{name}.pipe"));
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        assert!(!is_dicom(&pipe).unwrap(), "looking into a pipe would wait for a writer");
        let (from, to) = (std::fs::read(&file).unwrap(), pipe.clone());
        let writer = std::thread::spawn(move || std::fs::write(to, from));
        let read = read_cameras(&[pipe], &MM).unwrap();
        writer.join().unwrap().unwrap();
        assert_eq!(cameras(&read), cameras(&views), "{name}");
    }
}
