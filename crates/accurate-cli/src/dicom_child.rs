use std::path::Path;
use std::process::{Command, Stdio};

use accurate3d::io::{NamedView, read_dicom_view};

use crate::code::Code;
use crate::failure::Failure;

/// The hidden word that makes this program the reader of one DICOM file.
pub const WORD: &str = "__read-dicom";

/// Address space of the reader, bytes: a hostile file exhausts this and not the machine.
const MAX_ADDRESS_SPACE: u64 = 256 << 20;

/// In the child: the view as one line of JSON on stdout.
pub fn child(path: &Path) -> Result<(), Failure> {
    rlimit::setrlimit(rlimit::Resource::AS, MAX_ADDRESS_SPACE, MAX_ADDRESS_SPACE)
        .map_err(|error| Failure::new(Code::Internal, format!("cannot limit memory: {error}")))?;
    let view = read_dicom_view(path)?;
    let json = view
        .to_json()
        .map_err(|error| Failure::new(Code::Internal, format!("a view as JSON: {error}")))?;
    println!("{json}");
    Ok(())
}

/// The camera of a DICOM file, read by a child process whose memory is limited.
pub fn read_view(path: &Path) -> Result<NamedView, Failure> {
    let internal = |what: String| Failure::new(Code::Internal, what);
    let program = std::env::current_exe().map_err(|e| internal(format!("own program: {e}")))?;
    let output = Command::new(program)
        .args([WORD, "--json"])
        .arg(path)
        .stdin(Stdio::null())
        .output()
        .map_err(|e| internal(format!("cannot start the DICOM reader: {e}")))?;
    if output.status.success() {
        return Ok(NamedView::from_json(path, &String::from_utf8_lossy(&output.stdout))?);
    }
    // The child's own error is one line of JSON; without it, the child was stopped.
    let text = String::from_utf8_lossy(&output.stderr);
    let value: Option<serde_json::Value> = serde_json::from_str(text.trim()).ok();
    let field = |key: &str| value.as_ref()?.get(key)?.as_str().map(str::to_owned);
    match (field("error"), field("code").and_then(|code| code.parse::<Code>().ok())) {
        (Some(message), Some(code)) => {
            let failure = Failure::new(code, message);
            Err(match field("hint") {
                Some(hint) => failure.with_hint(hint),
                None => failure,
            })
        }
        _ => Err(Failure::new(
            Code::TooLarge,
            format!(
                "{}: the reader was stopped ({}); it may use {} MiB",
                path.display(),
                output.status,
                MAX_ADDRESS_SPACE >> 20
            ),
        )),
    }
}
