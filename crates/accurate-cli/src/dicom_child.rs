use std::ffi::OsString;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use accurate3d::io::{FrameChoice, NamedView, read_dicom_pixels, read_dicom_view, read_grey};
use ndarray::Array2;
use serde_json::{Value, json};

use crate::code::Code;
use crate::failure::Failure;

/// The hidden word that makes this program the reader of one DICOM file.
pub const WORD: &str = "__read-dicom";

/// Address space of the reader, bytes: a hostile file exhausts this and not the machine.
const MAX_ADDRESS_SPACE: u64 = 256 << 20;
/// The same where frames are decoded: the limit of decoded pixels, twice, and the file.
const MAX_ADDRESS_SPACE_PIXELS: u64 = 2 << 30;

/// In the child: the view as one line of JSON on stdout, or a frame as such a line and its values.
///
/// The words are `WORD --json PATH`, and for a frame one more: its index, or `mean`.
pub fn child(words: &[OsString]) -> Result<(), Failure> {
    let internal = |what: String| Failure::new(Code::Internal, what);
    let path = words.get(3).map(Path::new).ok_or_else(|| internal("no file to read".into()))?;
    let frame = words.get(4).map(|word| word.to_string_lossy().into_owned());
    let limit = if frame.is_some() { MAX_ADDRESS_SPACE_PIXELS } else { MAX_ADDRESS_SPACE };
    rlimit::setrlimit(rlimit::Resource::AS, limit, limit)
        .map_err(|error| internal(format!("cannot limit memory: {error}")))?;
    let Some(frame) = frame else {
        let json = read_dicom_view(path)?
            .to_json()
            .map_err(|error| internal(format!("a view as JSON: {error}")))?;
        println!("{json}");
        return Ok(());
    };
    let choice = frame.parse().map_or(FrameChoice::Mean, FrameChoice::One);
    let values = read_dicom_pixels(path, choice)?.windowed();
    let (height, width) = values.dim();
    let mut bytes = json!({"height": height, "width": width}).to_string().into_bytes();
    bytes.push(b'\n');
    bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    std::io::stdout()
        .lock()
        .write_all(&bytes)
        .map_err(|error| internal(format!("cannot hand over a frame: {error}")))
}

/// The camera of a DICOM file, read by a child process whose memory is limited.
pub fn read_view(path: &Path) -> Result<NamedView, Failure> {
    let said = run(path, None)?;
    Ok(NamedView::from_json(path, &String::from_utf8_lossy(&said))?)
}

/// A frame of a DICOM run, or the picture of an image file.
pub fn read_picture(path: &Path, dicom: bool, choice: FrameChoice) -> Result<Array2<f32>, Failure> {
    if dicom { read_frame(path, choice) } else { Ok(read_grey(path)?.values) }
}

/// A frame of a DICOM file through its window, 0 to 255, read by such a child.
fn read_frame(path: &Path, choice: FrameChoice) -> Result<Array2<f32>, Failure> {
    let word = match choice {
        FrameChoice::Mean => "mean".to_owned(),
        FrameChoice::One(index) => index.to_string(),
    };
    let said = run(path, Some(&word))?;
    let broken = || Failure::new(Code::Internal, format!("{}: no frame came", path.display()));
    let head = said.iter().position(|byte| *byte == b'\n').ok_or_else(broken)?;
    let size: Value = serde_json::from_slice(&said[..head]).map_err(|_| broken())?;
    let side = |key: &str| size[key].as_u64().and_then(|px| usize::try_from(px).ok());
    let (Some(height), Some(width)) = (side("height"), side("width")) else {
        return Err(broken());
    };
    let (values, rest) = said[head + 1..].as_chunks::<4>();
    let values = values.iter().map(|raw| f32::from_le_bytes(*raw)).collect();
    if !rest.is_empty() {
        return Err(broken());
    }
    Array2::from_shape_vec((height, width), values).map_err(|_| broken())
}

/// Runs the child; what it wrote to stdout.
fn run(path: &Path, frame: Option<&str>) -> Result<Vec<u8>, Failure> {
    let internal = |what: String| Failure::new(Code::Internal, what);
    let program = std::env::current_exe().map_err(|e| internal(format!("own program: {e}")))?;
    let output = Command::new(program)
        .args([WORD, "--json"])
        .arg(path)
        .args(frame)
        .stdin(Stdio::null())
        .output()
        .map_err(|e| internal(format!("cannot start the DICOM reader: {e}")))?;
    if output.status.success() {
        return Ok(output.stdout);
    }
    // The child's own error is one line of JSON; without it, the child was stopped.
    let text = String::from_utf8_lossy(&output.stderr);
    let value: Option<Value> = serde_json::from_str(text.trim()).ok();
    let field = |key: &str| value.as_ref()?.get(key)?.as_str().map(str::to_owned);
    match (field("error"), field("code").and_then(|code| code.parse::<Code>().ok())) {
        (Some(message), Some(code)) => {
            let failure = Failure::new(code, message);
            Err(match field("hint") {
                Some(hint) => failure.with_hint(hint),
                None => failure,
            })
        }
        _ => {
            let limit = if frame.is_some() { MAX_ADDRESS_SPACE_PIXELS } else { MAX_ADDRESS_SPACE };
            Err(Failure::new(
                Code::TooLarge,
                format!(
                    "{}: the reader was stopped ({}); it may use {} MiB",
                    path.display(),
                    output.status,
                    limit >> 20
                ),
            ))
        }
    }
}
