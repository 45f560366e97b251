//! Small DICOM XA files made from nothing: explicit little endian, uncompressed.

/// Tag, value representation and bytes.
pub type Element = ((u16, u16), [u8; 2], Vec<u8>);

pub fn text(tag: (u16, u16), vr: &[u8; 2], text: &str) -> Element {
    (tag, *vr, text.as_bytes().to_vec())
}

fn encoded(((group, element), vr, value): &Element) -> Vec<u8> {
    let mut bytes = [group.to_le_bytes(), element.to_le_bytes()].concat();
    let padding = value.len() % 2;
    bytes.extend(vr);
    if matches!(vr, b"OB" | b"OW" | b"UT" | b"UN") {
        bytes.extend([0, 0]);
        bytes.extend(((value.len() + padding) as u32).to_le_bytes());
    } else {
        bytes.extend(((value.len() + padding) as u16).to_le_bytes());
    }
    bytes.extend(value);
    bytes.resize(bytes.len() + padding, b' ');
    bytes
}

/// A C-arm view at these angles, degrees, with 8-bit frames of one value per pixel.
pub fn view(angles: [f64; 2], side: u16, pixels: &[u8], more: &[Element]) -> Vec<u8> {
    let short = |tag, value: u16| (tag, *b"US", value.to_le_bytes().to_vec());
    let frames = pixels.len() / (usize::from(side) * usize::from(side));
    let mut elements = vec![
        text((0x18, 0x1110), b"DS", "1080"),
        text((0x18, 0x1111), b"DS", "720"),
        text((0x18, 0x1164), b"DS", "0.8\\0.8"),
        text((0x18, 0x1510), b"DS", &angles[0].to_string()),
        text((0x18, 0x1511), b"DS", &angles[1].to_string()),
        short((0x28, 0x02), 1),
        text((0x28, 0x04), b"CS", "MONOCHROME2"),
        text((0x28, 0x08), b"IS", &frames.to_string()),
        short((0x28, 0x10), side),
        short((0x28, 0x11), side),
        short((0x28, 0x100), 8),
        short((0x28, 0x101), 8),
        short((0x28, 0x102), 7),
        short((0x28, 0x103), 0),
    ];
    elements.extend_from_slice(more);
    elements.push(((0x7fe0, 0x10), *b"OB", pixels.to_vec()));
    elements.sort_by_key(|element| element.0);
    let meta: Vec<u8> = [
        text((2, 2), b"UI", "1.2.840.10008.5.1.4.1.1.12.1\0"),
        text((2, 3), b"UI", "1.2.3\0"),
        text((2, 0x10), b"UI", "1.2.840.10008.1.2.1\0"),
    ]
    .iter()
    .flat_map(encoded)
    .collect();
    let mut bytes = vec![0; 128];
    bytes.extend(b"DICM");
    bytes.extend(encoded(&((2, 0), *b"UL", (meta.len() as u32).to_le_bytes().to_vec())));
    bytes.extend(meta);
    bytes.extend(elements.iter().flat_map(encoded));
    bytes
}
