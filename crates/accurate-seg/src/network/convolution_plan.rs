use std::collections::{HashMap, HashSet};

use super::onnx_proto::{GraphProto, NodeProto};

/// A convolution of a network that [`Convolution`](super::convolution::Convolution) can compute.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct PlannedConvolution {
    /// Names of the values that it takes, one after another: two where a network leads a skip in.
    pub(super) inputs: Vec<String>,
    /// Name of the value that it makes.
    pub(super) output: String,
    /// Names of its tensors as they are stored: in half precision, if they are cast.
    pub(super) weights: String,
    pub(super) bias: Option<String>,
    pub(super) stride: usize,
}

/// The convolutions of `graph` that can be computed by themselves, in the order in which they can be: with as
/// much padding as keeps the middle of a square kernel in the image, all channels together.
pub(super) fn plan(graph: &GraphProto) -> Vec<PlannedConvolution> {
    let makers = makers(graph);
    graph.node.iter().filter_map(|node| planned(&makers, node)).collect()
}

/// Of each value in `targets`, which of the values in `known` it is computed from, with nothing known in
/// between, and whether no later target is.
pub(super) fn needs(
    graph: &GraphProto,
    known: &[&str],
    targets: &[&str],
) -> Vec<Vec<(usize, bool)>> {
    let makers = makers(graph);
    let index: HashMap<&str, usize> = known.iter().enumerate().map(|(k, n)| (*n, k)).collect();
    let of = |target: &&str| {
        let (mut found, mut seen, mut open) = (Vec::new(), HashSet::new(), vec![*target]);
        while let Some(name) = open.pop() {
            if !seen.insert(name) {
                continue;
            }
            match (index.get(name), makers.get(name)) {
                (Some(k), _) => found.push(*k),
                (None, Some(node)) => open.extend(node.input.iter().map(String::as_str)),
                (None, None) => {}
            }
        }
        found.sort_unstable();
        found
    };
    let mut taken = HashSet::new();
    let mut needs: Vec<Vec<_>> = Vec::new();
    for target in targets.iter().rev() {
        needs.push(of(target).into_iter().map(|k| (k, taken.insert(k))).collect());
    }
    needs.reverse();
    needs
}

/// The node that makes each value.
type Makers<'g> = HashMap<&'g str, &'g NodeProto>;

fn makers(graph: &GraphProto) -> Makers<'_> {
    graph.node.iter().flat_map(|n| n.output.iter().map(move |o| (o.as_str(), n))).collect()
}

/// Larger strides leave out most of an image: they would be laid out in as many parts.
const MAX_STRIDE: i64 = 4;

fn planned(makers: &Makers<'_>, node: &NodeProto) -> Option<PlannedConvolution> {
    if node.op_type != "Conv" {
        return None;
    }
    let ints = |name: &str| node.attribute.iter().find(|a| a.name == name).map(|a| &a.ints[..]);
    let all = |name: &str, value: i64| ints(name).is_none_or(|n| n.iter().all(|v| *v == value));
    let group = node.attribute.iter().find(|a| a.name == "group").map_or(1, |a| a.i);
    let &[side, other] = ints("kernel_shape")? else { return None };
    let is_middle = side == other && side % 2 == 1 && all("pads", side / 2);
    let padded = side == 1 || ints("pads").is_some();
    let stride = ints("strides").map_or(1, |n| n.first().copied().unwrap_or(1));
    let alike = all("strides", stride) && all("dilations", 1) && group == 1;
    let known = is_middle && padded && alike && (1..=MAX_STRIDE).contains(&stride);
    let [input, weights, bias @ ..] = node.input.as_slice() else { return None };
    let [output] = node.output.as_slice() else { return None };
    known.then_some(PlannedConvolution {
        inputs: joined(makers, input),
        output: output.clone(),
        weights: stored(makers, weights).to_owned(),
        bias: bias.first().map(|name| stored(makers, name).to_owned()),
        stride: usize::try_from(stride).ok()?,
    })
}

/// The values that are concatenated along their channels to one, or the one.
fn joined(makers: &Makers<'_>, name: &str) -> Vec<String> {
    let is_channels = |node: &NodeProto| {
        node.attribute.iter().any(|a| a.name == "axis" && (a.i == 1 || a.i == -3))
    };
    let name = unchanged(makers, name);
    match makers.get(name) {
        Some(node) if node.op_type == "Concat" && is_channels(node) => {
            node.input.iter().map(|name| unchanged(makers, name).to_owned()).collect()
        }
        _ => vec![name.to_owned()],
    }
}

/// The value that an activation is a copy of. rten does without the copies, and can be asked for none; all
/// activations are float32 already.
fn unchanged<'g>(makers: &Makers<'g>, mut name: &'g str) -> &'g str {
    let copied = |name: &str| {
        let copy = makers.get(name).filter(|n| n.op_type == "Identity" || n.op_type == "Cast");
        copy.and_then(|node| node.input.first())
    };
    while let Some(original) = copied(name) {
        name = original;
    }
    name
}

/// The tensor that a weight is cast from, or the weight.
fn stored<'g>(makers: &Makers<'g>, name: &'g str) -> &'g str {
    let cast = makers.get(name).filter(|node| node.op_type == "Cast");
    cast.and_then(|node| node.input.first()).map_or(name, String::as_str)
}

#[cfg(test)]
mod tests {
    use super::super::onnx_proto::AttributeProto;
    use super::*;

    fn node(kind: &str, inputs: &[&str], output: &str, attributes: &[(&str, &[i64])]) -> NodeProto {
        let owned = |names: &[&str]| names.iter().map(|n| (*n).to_owned()).collect();
        let attribute = |(name, ints): &(&str, &[i64])| AttributeProto {
            name: (*name).to_owned(),
            i: ints[0],
            ints: ints.to_vec(),
            ..AttributeProto::default()
        };
        NodeProto {
            op_type: kind.to_owned(),
            input: owned(inputs),
            output: owned(&[output]),
            attribute: attributes.iter().map(attribute).collect(),
            ..NodeProto::default()
        }
    }

    const MIDDLE: [(&str, &[i64]); 2] = [("kernel_shape", &[3, 3]), ("pads", &[1, 1, 1, 1])];

    fn graph() -> GraphProto {
        let node = vec![
            node("Cast", &["half"], "w", &[("to", &[1])]),
            node("Conv", &["image", "w", "b"], "one", &MIDDLE),
            node("Relu", &["one"], "skip", &[]),
            node("Conv", &["skip", "v"], "two", &MIDDLE),
            node("Concat", &["two", "skip"], "both", &[("axis", &[1])]),
            node("Conv", &["both", "u"], "three", &MIDDLE),
        ];
        GraphProto { node, ..GraphProto::default() }
    }

    #[test]
    fn tensors_are_named_as_stored_and_concatenated_inputs_one_by_one() {
        let planned = plan(&graph());
        assert_eq!(planned.len(), 3);
        assert_eq!((planned[0].weights.as_str(), planned[0].bias.as_deref()), ("half", Some("b")));
        assert_eq!((planned[1].weights.as_str(), planned[1].bias.as_deref()), ("v", None));
        assert_eq!(planned[2].inputs, ["two", "skip"]);
        assert!(planned.iter().all(|planned| planned.stride == 1));
    }

    #[test]
    fn what_a_value_needs_is_the_nearest_known_and_the_last_to_take_it_is_told() {
        let known = ["image", "one", "two", "three"];
        let found = needs(&graph(), &known, &["image", "skip", "two", "skip", "three"]);
        let expected =
            [vec![(0, true)], vec![(1, false)], vec![(2, true)], vec![(1, true)], vec![(3, true)]];
        assert_eq!(found, expected);
        // With nothing else known all comes from the image.
        assert_eq!(needs(&graph(), &known[..1], &["three"]), [[(0, true)]]);
    }

    #[test]
    fn other_convolutions_are_left_alone() {
        let others: [&[(&str, &[i64])]; 8] = [
            &[("kernel_shape", &[3, 3])],
            &[("kernel_shape", &[3, 3]), ("pads", &[1, 1, 1, 0])],
            &[("kernel_shape", &[3, 1]), ("pads", &[1, 1, 1, 1])],
            &[("kernel_shape", &[2, 2]), ("pads", &[1, 1, 1, 1])],
            &[MIDDLE[0], MIDDLE[1], ("strides", &[2, 1])],
            &[MIDDLE[0], MIDDLE[1], ("dilations", &[2, 2])],
            &[MIDDLE[0], MIDDLE[1], ("group", &[2])],
            &[MIDDLE[0], MIDDLE[1], ("strides", &[9, 9])],
        ];
        for attributes in others {
            let node = vec![node("Conv", &["image", "w"], "out", attributes)];
            assert_eq!(plan(&GraphProto { node, ..GraphProto::default() }), [], "{attributes:?}");
        }
        let one = node("Conv", &["image", "w"], "out", &[("kernel_shape", &[1, 1])]);
        let strided = [MIDDLE[0], MIDDLE[1], ("strides", &[2, 2])];
        let two = node("Conv", &["image", "w"], "out", &strided);
        let planned = plan(&GraphProto { node: vec![one, two], ..GraphProto::default() });
        assert_eq!(planned.iter().map(|p| p.stride).collect::<Vec<_>>(), [1, 2]);
    }
}
