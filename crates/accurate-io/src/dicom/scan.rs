//! One pass over the elements of a DICOM file without taking memory for any of them.

/// Deepest nesting of sequences accepted; XA files have 2 or 3.
const MAX_DEPTH: usize = 16;
/// Most elements and items accepted.
const MAX_ELEMENTS: usize = 200_000;
/// Largest value other than pixel data, bytes.
const MAX_VALUE_BYTES: usize = 16 << 20;

const UNDEFINED: usize = u32::MAX as usize;
const ITEM: (u16, u16) = (0xfffe, 0xe000);
const ITEM_END: (u16, u16) = (0xfffe, 0xe00d);
const SEQUENCE_END: (u16, u16) = (0xfffe, 0xe0dd);
const PIXEL_DATA: (u16, u16) = (0x7fe0, 0x0010);

/// What is open at a place of the file.
struct Level {
    /// Where it ends, if its length is defined.
    end: Option<usize>,
    /// A sequence holds items, an item holds elements.
    holds_items: bool,
    /// Items of encapsulated pixel data are bytes, not elements.
    fragments: bool,
    /// Whether elements inside are written without their type.
    implicit: bool,
}

/// Compares every declared length with the bytes that are there, and bounds nesting and counts.
///
/// Reads explicit and implicit little endian, which every transfer syntax in use has but two: big
/// endian (retired) and deflated are refused.
pub(super) fn scan(bytes: &[u8]) -> Result<(), String> {
    if bytes.get(128..132) != Some(b"DICM") {
        return Err("no DICM after the preamble".into());
    }
    let mut at = 132;
    let mut elements = 0usize;
    let mut implicit = false;
    let mut in_meta = true;
    let mut levels: Vec<Level> = Vec::new();
    while at < bytes.len() {
        elements += 1;
        if elements > MAX_ELEMENTS {
            return Err(format!("more than {MAX_ELEMENTS} elements"));
        }
        while levels.last().is_some_and(|level| level.end.is_some_and(|end| at >= end)) {
            levels.pop();
        }
        let outer = levels.last().and_then(|level| level.end);
        let end = outer.unwrap_or(bytes.len());
        let tag = (u16_at(bytes, at)?, u16_at(bytes, at + 2)?);
        if in_meta && tag.0 != 2 {
            in_meta = false;
        }
        if tag.0 == 0xfffe {
            let length = u32_at(bytes, at + 4)?;
            at += 8;
            match tag {
                ITEM => {
                    let Some(level) = levels.last().filter(|level| level.holds_items) else {
                        return Err(format!("an item outside a sequence at byte {at}"));
                    };
                    let (fragments, implicit) = (level.fragments, level.implicit);
                    if fragments {
                        at = within(at, length, end)?;
                    } else {
                        let end =
                            if length == UNDEFINED { None } else { Some(within(at, length, end)?) };
                        open(
                            &mut levels,
                            Level { end: end.or(outer), holds_items: false, fragments, implicit },
                        )?;
                    }
                }
                ITEM_END | SEQUENCE_END => {
                    levels.pop();
                }
                _ => return Err(format!("an unknown delimiter at byte {at}")),
            }
            continue;
        }
        if levels.last().is_some_and(|level| level.holds_items) {
            return Err(format!("a sequence holds no item at byte {at}"));
        }
        let untyped = !in_meta && levels.last().map_or(implicit, |level| level.implicit);
        let (vr, length, header) = if untyped {
            (*b"??", u32_at(bytes, at + 4)?, 8)
        } else {
            let vr = [byte_at(bytes, at + 4)?, byte_at(bytes, at + 5)?];
            if !vr.iter().all(u8::is_ascii_uppercase) {
                return Err(format!("no value representation at byte {}", at + 4));
            }
            match &vr {
                b"OB" | b"OD" | b"OF" | b"OL" | b"OV" | b"OW" | b"SQ" | b"SV" | b"UC" | b"UN"
                | b"UR" | b"UT" | b"UV" => (vr, u32_at(bytes, at + 8)?, 12),
                _ => (vr, u16_at(bytes, at + 6)?.into(), 8),
            }
        };
        at += header;
        if length == UNDEFINED {
            // A sequence, one whose type is unknown (then it is implicit), or pixels in fragments.
            let fragments = tag == PIXEL_DATA;
            let implicit = untyped || &vr == b"UN";
            open(&mut levels, Level { end: outer, holds_items: true, fragments, implicit })?;
            continue;
        }
        let value_end = within(at, length, end)?;
        if &vr == b"SQ" {
            open(
                &mut levels,
                Level {
                    end: Some(value_end),
                    holds_items: true,
                    fragments: false,
                    implicit: untyped,
                },
            )?;
            continue;
        }
        if length > MAX_VALUE_BYTES && tag != PIXEL_DATA {
            return Err(format!("a value of {length} bytes; at most {MAX_VALUE_BYTES} are read"));
        }
        if in_meta && tag == (2, 0x0010) {
            let uid = bytes[at..value_end].trim_ascii_end();
            let uid = uid.strip_suffix(b"\0").unwrap_or(uid);
            match uid {
                b"1.2.840.10008.1.2" => implicit = true,
                b"1.2.840.10008.1.2.2" => return Err("big endian files are not read".into()),
                b"1.2.840.10008.1.2.1.99" => return Err("deflated files are not read".into()),
                _ => {}
            }
        }
        at = value_end;
    }
    Ok(())
}

fn open(levels: &mut Vec<Level>, level: Level) -> Result<(), String> {
    // A sequence and its item are one level of nesting.
    if levels.len() >= 2 * MAX_DEPTH {
        return Err(format!("sequences nested deeper than {MAX_DEPTH}"));
    }
    levels.push(level);
    Ok(())
}

fn within(at: usize, length: usize, end: usize) -> Result<usize, String> {
    match at.checked_add(length) {
        Some(value_end) if value_end <= end => Ok(value_end),
        _ => Err(format!(
            "{length} bytes declared at byte {at}, {} are left",
            end.saturating_sub(at)
        )),
    }
}

fn byte_at(bytes: &[u8], at: usize) -> Result<u8, String> {
    bytes
        .get(at)
        .copied()
        .ok_or_else(|| format!("the file ends at byte {} within an element", bytes.len()))
}

fn u16_at(bytes: &[u8], at: usize) -> Result<u16, String> {
    Ok(u16::from_le_bytes([byte_at(bytes, at)?, byte_at(bytes, at + 1)?]))
}

fn u32_at(bytes: &[u8], at: usize) -> Result<usize, String> {
    let low = usize::from(u16_at(bytes, at)?);
    Ok(low | usize::from(u16_at(bytes, at + 2)?) << 16)
}
