use accurate3d::io::{CameraFormat, NamedView, write_cameras};
use serde_json::json;

use super::doctor;
use crate::args::{CameraArgs, CameraCommand, CameraTarget, ConvertArgs};
use crate::console::Console;
use crate::failure::Failure;
use crate::text::{make_folder, make_place, places, refuse_what_is_read};
use crate::two_views::cameras_of;

/// `accurate camera`: what camera files say, in one convention, and in another tool's.
pub fn run(command: &CameraCommand, console: &Console) -> Result<(), Failure> {
    match command {
        CameraCommand::Show(args) => show(args, console),
        CameraCommand::Convert(args) => convert(args, console),
        CameraCommand::Doctor(args) => doctor::run(args, console),
    }
}

fn views(args: &CameraArgs) -> Result<Vec<NamedView>, Failure> {
    cameras_of(&args.files, &args.stated.defaults())
}

fn show(args: &CameraArgs, console: &Console) -> Result<(), Failure> {
    for view in views(args)? {
        if console.json {
            let json = view
                .to_json()
                .map_err(|e| Failure::new(Failure::INTERNAL, format!("a view as JSON: {e}")))?;
            console.json(&json)?;
        } else {
            console.data(&described(&view))?;
        }
    }
    Ok(())
}

fn described(view: &NamedView) -> String {
    let camera = &view.camera;
    let (size, centre) = (camera.size(), camera.centre());
    let mut text =
        format!("{}: {} x {} px, world: {}", view.name, size.width, size.height, view.frame);
    for (r, name) in [(0, "K [R | t] = P"), (1, ""), (2, "")] {
        let (k, rot, t) = (camera.k().row(r), camera.r().row(r), camera.t()[r]);
        text.push_str(&format!(
            "\n  {name:<14}{:>11.3} {:>9.3} {:>10.3}  |{:>10.6} {:>10.6} {:>10.6}  |{t:>11.4}",
            k[0], k[1], k[2], rot[0], rot[1], rot[2]
        ));
    }
    text.push_str(&format!(
        "\n  centre        ({:.3}, {:.3}, {:.3}) {}",
        centre.x, centre.y, centre.z, view.unit
    ));
    if let Some(d) = camera.distortion() {
        text.push_str(&format!(
            "\n  lens          k1 {} k2 {} p1 {} p2 {} k3 {}",
            d.k1, d.k2, d.p1, d.p2, d.k3
        ));
    }
    for note in &view.notes {
        text.push_str(&format!("\n  note          {note}"));
    }
    text
}

fn convert(args: &ConvertArgs, console: &Console) -> Result<(), Failure> {
    let format = match args.to {
        CameraTarget::OpencvYaml => CameraFormat::OpencvYaml,
        CameraTarget::OpencvXml => CameraFormat::OpencvXml,
        CameraTarget::Colmap => CameraFormat::Colmap,
        CameraTarget::RigToml | CameraTarget::RigJson => CameraFormat::Rig,
        CameraTarget::PTxt => CameraFormat::MatrixText,
        CameraTarget::ViewsJson => CameraFormat::ViewsJson,
    };
    let extension = match args.to {
        CameraTarget::RigToml => Some("toml"),
        CameraTarget::RigJson => Some("json"),
        _ => None,
    };
    if let Some(extension) = extension
        && args.out.extension().and_then(|e| e.to_str()) != Some(extension)
    {
        let message = format!("{}: a rig of this kind ends in .{extension}", args.out.display());
        return Err(Failure::new(Failure::USAGE, message));
    }
    refuse_what_is_read(&args.out, &places(&args.cameras.files))?;
    if format == CameraFormat::Colmap {
        make_folder(&args.out)?;
    } else {
        make_place(&args.out)?;
    }
    let views = views(&args.cameras)?;
    write_cameras(&args.out, &views, format).map_err(Failure::of_output)?;
    for view in &views {
        for note in &view.notes {
            console.remark(&format!("{}: {note}", view.name));
        }
    }
    if console.json {
        let names: Vec<&str> = views.iter().map(|view| view.name.as_str()).collect();
        return console.json(&json!({"file": args.out.display().to_string(), "views": names}));
    }
    console.remark(&format!("{} views in {}", views.len(), args.out.display()));
    Ok(())
}
