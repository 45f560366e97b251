use std::collections::BTreeMap;
use std::path::Path;

use accurate_geom::nalgebra::DMatrix;
use quick_xml::Reader;
use quick_xml::events::Event;
use serde::Deserialize;

use crate::IoError;
use crate::matrix::finite;

/// Deepest nesting accepted; OpenCV's calibration files have 3.
const MAX_DEPTH: usize = 16;
/// Largest matrix accepted, entries.
const MAX_ENTRIES: usize = 4096;

/// A value of an OpenCV FileStorage.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(untagged)]
pub(crate) enum Node {
    Number(f64),
    Flag(bool),
    Text(String),
    List(Vec<Node>),
    Map(BTreeMap<String, Node>),
    Nothing(()),
}

pub(crate) type Storage = BTreeMap<String, Node>;

/// Reads OpenCV's YAML. It is not YAML: the directive `%YAML:1.0` and the tags of matrices are dropped
/// before a YAML parser sees it.
pub(crate) fn read_yaml(path: &Path, text: &str) -> Result<Storage, IoError> {
    let malformed = |line, reason: String| IoError::malformed(path, "OpenCV YAML", line, reason);
    let mut depth = 0usize;
    for (index, line) in text.lines().enumerate() {
        let indent = line.len() - line.trim_start().len();
        for c in line.chars() {
            match c {
                '[' | '{' => depth += 1,
                ']' | '}' => depth = depth.saturating_sub(1),
                _ => {}
            }
            if depth > MAX_DEPTH || indent > 4 * MAX_DEPTH {
                let reason = format!("nested deeper than {MAX_DEPTH}");
                return Err(malformed(Some(index + 1), reason));
            }
        }
    }
    // Lines stay where they are, so that an error's line number is the file's.
    let plain: String = text
        .lines()
        .map(|line| if line.starts_with('%') || line.trim_end() == "---" { "" } else { line })
        .map(|line| line.replace("!!opencv-matrix", "").replace("!!opencv-nd-matrix", ""))
        .collect::<Vec<_>>()
        .join("\n");
    serde_saphyr::from_str(&plain).map_err(|e| {
        let line = e.location().map(|l| l.line() as usize);
        malformed(line, e.to_string())
    })
}

struct Open {
    name: String,
    children: Vec<(String, Node)>,
    text: String,
}

/// Reads OpenCV's XML. Document types and entities other than those of XML itself are refused.
pub(crate) fn read_xml(path: &Path, text: &str) -> Result<Storage, IoError> {
    let malformed = |line, reason: String| IoError::malformed(path, "OpenCV XML", line, reason);
    let mut reader = Reader::from_str(text);
    let mut open: Vec<Open> = Vec::new();
    loop {
        let at = usize::try_from(reader.buffer_position()).unwrap_or(usize::MAX);
        let line = Some(crate::rig_file::line_at(text, at));
        match reader.read_event().map_err(|e| malformed(line, e.to_string()))? {
            Event::Start(tag) => {
                if open.len() >= MAX_DEPTH {
                    return Err(malformed(line, format!("nested deeper than {MAX_DEPTH}")));
                }
                let name = tag.name().as_ref().to_owned();
                if open.is_empty() && name != "opencv_storage" {
                    let what = format!(
                        "XML with root <{}>; expected <opencv_storage>",
                        crate::error::cut(&name, 40)
                    );
                    return Err(IoError::Unsupported { path: path.to_owned(), what });
                }
                open.push(Open { name, children: Vec::new(), text: String::new() });
            }
            Event::Text(content) => {
                if let Some(element) = open.last_mut() {
                    element.text.push_str(&content.into_inner());
                }
            }
            Event::End(_) => {
                let Some(element) = open.pop() else {
                    return Err(malformed(line, "an element ends that never began".into()));
                };
                let node = element.node();
                match open.last_mut() {
                    Some(parent) => parent.children.push((element.name, node)),
                    None => {
                        return match node {
                            Node::Map(map) => Ok(map),
                            _ => Err(malformed(line, "no values".into())),
                        };
                    }
                }
            }
            Event::Empty(tag) => {
                let name = tag.name().as_ref().to_owned();
                if let Some(parent) = open.last_mut() {
                    parent.children.push((name, Node::Nothing(())));
                }
            }
            Event::Eof => return Err(malformed(line, "the file ends within an element".into())),
            Event::DocType(_) | Event::GeneralRef(_) | Event::CData(_) => {
                let what = "document types, entities and CDATA are not read".into();
                return Err(IoError::Unsupported { path: path.to_owned(), what });
            }
            Event::Comment(_) | Event::Decl(_) | Event::PI(_) => {}
        }
    }
}

impl Open {
    fn node(&self) -> Node {
        if self.children.iter().any(|(name, _)| name == "_") {
            return Node::List(self.children.iter().map(|(_, node)| node.clone()).collect());
        }
        if !self.children.is_empty() {
            return Node::Map(self.children.iter().cloned().collect());
        }
        let fields: Vec<&str> = self.text.split_whitespace().collect();
        // OpenCV writes 0. and .Nan; Rust reads the first, and the second must not become a text.
        let number = |text: &str| -> Option<f64> {
            match text {
                ".Nan" | ".NaN" => Some(f64::NAN),
                ".Inf" => Some(f64::INFINITY),
                "-.Inf" => Some(f64::NEG_INFINITY),
                _ => text.parse().ok(),
            }
        };
        let numbers: Option<Vec<f64>> = fields.iter().map(|f| number(f)).collect();
        match (numbers, &fields[..]) {
            (Some(numbers), [_]) => Node::Number(numbers[0]),
            (Some(numbers), [_, _, ..]) => {
                Node::List(numbers.into_iter().map(Node::Number).collect())
            }
            _ => Node::Text(self.text.trim().trim_matches('"').to_owned()),
        }
    }
}

/// The matrix under the first of `keys` that the storage has: `rows`, `cols`, `data`, or as OpenCV 5
/// writes an array of one dimension, `sizes` and `data`, then a column.
pub(crate) fn matrix(
    path: &Path,
    storage: &Storage,
    keys: &[String],
) -> Result<Option<DMatrix<f64>>, IoError> {
    let Some((key, node)) = keys.iter().find_map(|key| storage.get(key).map(|node| (key, node)))
    else {
        return Ok(None);
    };
    let wrong = |reason: &str| IoError::field(path, key.as_str(), "", reason);
    let Node::Map(map) = node else {
        return Err(wrong("expected a matrix with rows, cols and data"));
    };
    let count = |node: Option<&Node>| match node {
        Some(Node::Number(v)) if *v >= 1.0 && *v <= MAX_ENTRIES as f64 && v.fract() == 0.0 => {
            Ok(*v as usize)
        }
        _ => Err(wrong("rows, cols or sizes must be whole numbers from 1 to 4096")),
    };
    // XML does not tell a list of one from a number.
    let list = |name: &str| match map.get(name) {
        Some(Node::List(list)) => Some(list.as_slice()),
        Some(one @ Node::Number(_)) => Some(std::slice::from_ref(one)),
        _ => None,
    };
    let (rows, cols) = match list("sizes") {
        None => (count(map.get("rows"))?, count(map.get("cols"))?),
        Some([rows]) => (count(Some(rows))?, 1),
        Some([rows, cols]) => (count(Some(rows))?, count(Some(cols))?),
        Some(sizes) => {
            let reason = format!("has {} dimensions; expected 1 or 2", sizes.len());
            return Err(IoError::field(path, key.as_str(), "", reason));
        }
    };
    let data = list("data").ok_or_else(|| wrong("data must be a list of numbers"))?;
    if rows * cols > MAX_ENTRIES || data.len() != rows * cols {
        let reason = format!("{rows} x {cols} entries stated, {} given", data.len());
        return Err(IoError::field(path, key.as_str(), "", reason));
    }
    let mut values = Vec::with_capacity(data.len());
    for (index, node) in data.iter().enumerate() {
        match node {
            Node::Number(v) => values.push(finite(path, *v, || format!("{key}[{index}]"))?),
            _ => return Err(wrong("data must be a list of numbers")),
        }
    }
    Ok(Some(DMatrix::from_row_slice(rows, cols, &values)))
}
