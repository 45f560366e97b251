use prost::bytes::Buf;
use prost::encoding::{DecodeContext, WireType, decode_key, decode_varint, skip_field};

use super::ModelError;

/// Most fields that a network's graph may have. The widest U-Nets have some thousands; decoding a
/// field takes up to some hundred bytes, so that this bounds the memory a small hostile file can
/// ask for.
const MAX_FIELDS: u64 = 200_000;

/// Refuses a network that would decode to far more memory than it has bytes.
///
/// Walks the wire format without allocating, through those messages only that are decoded later.
///
/// # Errors
/// [`ModelError::TooLarge`], [`ModelError::NotOnnx`] if the wire format is broken.
pub(super) fn check_field_count(network: &[u8]) -> Result<(), ModelError> {
    let mut count = 0;
    walk(network, Level::Model, &mut count)
}

/// A message that is decoded.
#[derive(Clone, Copy, PartialEq)]
enum Level {
    Model,
    Graph,
    Node,
    Attribute,
    Tensor,
}

impl Level {
    /// The message that a field of this one holds, if it is looked into.
    fn field(self, tag: u32) -> Option<Self> {
        match (self, tag) {
            (Self::Model, 7) => Some(Self::Graph),
            (Self::Graph, 1) => Some(Self::Node),
            (Self::Graph, 5) => Some(Self::Tensor),
            (Self::Node, 5) => Some(Self::Attribute),
            _ => None,
        }
    }

    /// Whether a length-delimited field holds many values, each of which takes memory: packed
    /// numbers (dims, floats, ints) and the descriptions of inputs and outputs.
    fn counts_bytes(self, tag: u32) -> bool {
        match self {
            Self::Tensor => tag == 1,
            Self::Attribute => matches!(tag, 7 | 8),
            Self::Graph => matches!(tag, 11 | 12),
            Self::Model => tag == 8,
            Self::Node => false,
        }
    }
}

fn walk(mut bytes: &[u8], level: Level, count: &mut u64) -> Result<(), ModelError> {
    let not_onnx = |error: prost::DecodeError| ModelError::NotOnnx { message: error.to_string() };
    while bytes.has_remaining() {
        *count += 1;
        let (tag, wire) = decode_key(&mut bytes).map_err(not_onnx)?;
        if wire == WireType::LengthDelimited {
            let length = decode_varint(&mut bytes).map_err(not_onnx)?;
            let Some((field, rest)) =
                usize::try_from(length).ok().and_then(|n| bytes.split_at_checked(n))
            else {
                return Err(ModelError::NotOnnx {
                    message: format!(
                        "a field of {length} bytes where {} are left",
                        bytes.remaining()
                    ),
                });
            };
            bytes = rest;
            if let Some(inner) = level.field(tag) {
                walk(field, inner, count)?;
            } else if level.counts_bytes(tag) {
                *count += length;
            }
        } else {
            skip_field(wire, tag, &mut bytes, DecodeContext::default()).map_err(not_onnx)?;
        }
        if *count > MAX_FIELDS {
            return Err(ModelError::TooLarge {
                what: "fields of the network's graph",
                found: *count,
                limit: MAX_FIELDS,
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_file_of_a_million_empty_nodes_is_refused_without_decoding_it() {
        // Field 1 of the graph, length 0.
        let graph = [0x0a, 0x00].repeat(1_000_000);
        let mut model = vec![0x3a];
        prost::encoding::encode_varint(graph.len() as u64, &mut model);
        model.extend(graph);
        assert!(matches!(check_field_count(&model), Err(ModelError::TooLarge { .. })));
    }

    #[test]
    fn a_field_longer_than_its_file_is_refused() {
        let error = check_field_count(&[0x3a, 0x7f, 0x00]).unwrap_err();
        assert!(error.to_string().contains("127 bytes where 1 are left"), "{error}");
    }
}
