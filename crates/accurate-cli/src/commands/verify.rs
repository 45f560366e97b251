use accurate3d::io::hash_file;
use serde_json::json;

use super::reproduce::{MANIFEST, Manifest, Size, table1};
use crate::args::VerifyArgs;
use crate::code::Code;
use crate::console::Console;
use crate::failure::Failure;
use crate::text::read_text;

/// `accurate verify DIR`: the files are what the manifest says, and a new run gives them again.
pub fn run(args: &VerifyArgs, console: &Console) -> Result<(), Failure> {
    let path = args.dir.join(MANIFEST);
    let manifest: Manifest = serde_json::from_str(&read_text(&path)?).map_err(|error| {
        Failure::new(Code::Malformed, format!("{}: {error}", path.display()))
            .with_hint("give a folder that `accurate reproduce` wrote")
    })?;
    if manifest.experiment != "table1" {
        return Err(Failure::new(
            Code::Unsupported,
            format!("{}: unknown experiment `{}`", path.display(), manifest.experiment),
        ));
    }
    let Manifest { seeds, cases, image_cases, .. } = &manifest;
    let size = Size { seeds, cases: *cases, image_cases: *image_cases };
    let (again, _) = table1(size, &args.model, console)?;
    let mut problems = Vec::new();
    if again.segmentation != manifest.segmentation {
        let said = |text: &Option<String>| text.clone().unwrap_or_else(|| "nothing".to_owned());
        problems.push(format!(
            "the images were segmented by {}, now by {}",
            said(&manifest.segmentation),
            said(&again.segmentation)
        ));
    }
    for (set, hash) in &manifest.data_blake3 {
        if again.data_blake3.get(set) != Some(hash) {
            problems.push(format!("the cases of {set} are others"));
        }
    }
    for (name, hash) in &manifest.files_blake3 {
        if hash_file(&args.dir.join(name))? != *hash {
            problems.push(format!("{name} was changed after the run"));
        }
        if again.files_blake3.get(name) != Some(hash) {
            problems.push(format!("{name} comes out differently"));
        }
    }
    let same_binary = manifest.binary_blake3 == again.binary_blake3;
    if console.json {
        console.json(&json!({
            "verified": problems.is_empty(),
            "same_binary": same_binary,
            "problems": problems,
        }))?;
    } else if problems.is_empty() {
        console.data(&format!(
            "verified: {} files and {} sets of cases are the same",
            manifest.files_blake3.len(),
            manifest.data_blake3.len()
        ))?;
    }
    if problems.is_empty() {
        if !same_binary {
            console.remark("another build of the program made them, with the same result");
        }
        return Ok(());
    }
    let binary = if same_binary { "the same program" } else { "another build of the program" };
    Err(Failure::new(Code::NotReproduced, format!("{} ({binary})", problems.join("; "))))
}
