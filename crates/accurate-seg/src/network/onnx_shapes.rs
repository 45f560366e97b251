use std::collections::HashMap;

use super::ModelError;
use super::onnx_proto::{AttributeProto, FLOAT, KIND_FLOAT, KIND_INT, KIND_INTS, NodeProto};

/// What is known of a value of the network.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Value {
    /// float32 weights.
    Weights(Vec<u64>),
    /// float16 weights, which have to be cast before use.
    HalfWeights(Vec<u64>),
    /// float32, (N, C, H, W) for the image size that is tried.
    Activation([u64; 4]),
}

impl Value {
    pub(super) fn dims(&self) -> &[u64] {
        match self {
            Self::Weights(dims) | Self::HalfWeights(dims) => dims,
            Self::Activation(dims) => dims,
        }
    }
}

/// Most numbers that one value may have for each pixel of the image. The widest layer of nnU-Net's
/// own plans has 32 at full size; with it, memory is bounded by the image.
const MAX_VALUES_PER_PX: u64 = 512;
/// Largest kernel side, stride, dilation and padding, px.
const MAX_EXTENT: i64 = 64;

/// The value that a node makes, for the operations that networks of U-Net's kind are built of.
///
/// # Errors
/// [`ModelError::Unsupported`] for other operations or attributes, [`ModelError::BadNetwork`] for
/// shapes that do not go together, [`ModelError::TooLarge`] for values far larger than the image.
pub(super) fn infer(
    node: &NodeProto,
    index: usize,
    values: &HashMap<String, Value>,
    image_px: u64,
) -> Result<Value, ModelError> {
    if !(node.domain.is_empty() || node.domain == "ai.onnx") || !node.overload.is_empty() {
        return Err(ModelError::unsupported(format!(
            "operation {} of domain `{}` (node {index})",
            node.op_type, node.domain
        )));
    }
    let at = At { node, index };
    let inputs: Vec<&Value> = node
        .input
        .iter()
        .map(|name| {
            values
                .get(name)
                .ok_or_else(|| at.bad(format!("reads `{name}`, which nothing before it has made")))
        })
        .collect::<Result<_, _>>()?;
    let value = match node.op_type.as_str() {
        "Conv" => at.conv(&inputs)?,
        "ConvTranspose" => at.conv_transpose(&inputs)?,
        "MaxPool" | "AveragePool" => at.pool(&inputs)?,
        "InstanceNormalization" => at.norm(&inputs)?,
        "LeakyRelu" => {
            at.knows(&["alpha"])?;
            at.one_activation(&inputs)?
        }
        "Relu" => {
            at.knows(&[])?;
            at.one_activation(&inputs)?
        }
        "Identity" => {
            at.knows(&[])?;
            at.only(&inputs)?.clone()
        }
        "Cast" => at.cast(&inputs)?,
        "Concat" => at.concat(&inputs)?,
        "Add" => at.add(&inputs)?,
        other => {
            return Err(ModelError::unsupported(format!("operation {other} (node {index})")));
        }
    };
    if let Value::Activation(dims) = &value {
        let size = dims.iter().fold(1_u64, |n, d| n.saturating_mul(*d));
        let limit = MAX_VALUES_PER_PX.saturating_mul(image_px);
        if size > limit {
            let what = "values of one operation of the network";
            return Err(ModelError::TooLarge { what, found: size, limit });
        }
    }
    Ok(value)
}

struct At<'n> {
    node: &'n NodeProto,
    index: usize,
}

/// A window that moves over rows and columns: `[begin, end]` padding of each.
struct Window {
    kernel: [i64; 2],
    strides: [i64; 2],
    dilations: [i64; 2],
    pads: [[i64; 2]; 2],
}

impl At<'_> {
    fn bad(&self, message: impl std::fmt::Display) -> ModelError {
        ModelError::bad_network(format!("node {} ({}) {message}", self.index, self.node.op_type))
    }

    fn attribute(&self, name: &str) -> Option<&AttributeProto> {
        self.node.attribute.iter().find(|a| a.name == name)
    }

    /// Refuses attributes whose meaning is not accounted for.
    fn knows(&self, names: &[&str]) -> Result<(), ModelError> {
        match self.node.attribute.iter().find(|a| !names.contains(&a.name.as_str())) {
            None => Ok(()),
            Some(other) => Err(ModelError::unsupported(format!(
                "attribute `{}` of node {} ({})",
                other.name, self.index, self.node.op_type
            ))),
        }
    }

    fn int(&self, name: &str, default: i64) -> Result<i64, ModelError> {
        match self.attribute(name) {
            None => Ok(default),
            Some(a) if a.kind == KIND_INT => Ok(a.i),
            Some(_) => Err(self.bad(format!("has no number as `{name}`"))),
        }
    }

    /// `N` numbers between `low` and [`MAX_EXTENT`].
    fn extents<const N: usize>(
        &self,
        name: &str,
        low: i64,
        default: [i64; N],
    ) -> Result<[i64; N], ModelError> {
        let Some(attribute) = self.attribute(name) else { return Ok(default) };
        let numbers = <[i64; N]>::try_from(attribute.ints.as_slice()).ok();
        numbers
            .filter(|_| attribute.kind == KIND_INTS)
            .filter(|n| n.iter().all(|v| (low..=MAX_EXTENT).contains(v)))
            .ok_or_else(|| {
                self.bad(format!(
                    "has `{name}` {:?}; expected {N} numbers of {low} to {MAX_EXTENT}",
                    attribute.ints
                ))
            })
    }

    fn window(&self, kernel: [i64; 2]) -> Result<Window, ModelError> {
        let declared = self.extents("kernel_shape", 1, kernel)?;
        if declared != kernel {
            return Err(self.bad(format!("has kernel_shape {declared:?} for weights {kernel:?}")));
        }
        if kernel.iter().any(|k| !(1..=MAX_EXTENT).contains(k)) {
            return Err(self.bad(format!("has a kernel of {kernel:?} px")));
        }
        let [top, left, bottom, right] = self.extents("pads", 0, [0; 4])?;
        Ok(Window {
            kernel,
            strides: self.extents("strides", 1, [1; 2])?,
            dilations: self.extents("dilations", 1, [1; 2])?,
            pads: [[top, bottom], [left, right]],
        })
    }

    fn only<'v>(&self, inputs: &[&'v Value]) -> Result<&'v Value, ModelError> {
        match inputs {
            [one] => Ok(one),
            _ => Err(self.bad(format!("has {} inputs; expected 1", inputs.len()))),
        }
    }

    fn activation(&self, value: &Value) -> Result<[u64; 4], ModelError> {
        match value {
            Value::Activation(dims) => Ok(*dims),
            weights => Err(self.bad(format!("takes weights of {:?} as an image", weights.dims()))),
        }
    }

    fn one_activation(&self, inputs: &[&Value]) -> Result<Value, ModelError> {
        Ok(Value::Activation(self.activation(self.only(inputs)?)?))
    }

    /// One weight a channel.
    fn per_channel(&self, value: &Value, channels: u64) -> Result<(), ModelError> {
        match value {
            Value::Weights(dims) if dims.as_slice() == [channels] => Ok(()),
            other => Err(self.bad(format!("has {other:?}; expected {channels} weights"))),
        }
    }

    /// Image, kernel of rank 4 and an optional bias.
    fn kernel(&self, inputs: &[&Value]) -> Result<([u64; 4], [u64; 4]), ModelError> {
        if !(2..=3).contains(&inputs.len()) {
            return Err(self.bad(format!("has {} inputs; expected 2 or 3", inputs.len())));
        }
        let image = self.activation(inputs[0])?;
        match inputs[1] {
            Value::Weights(dims) => match <[u64; 4]>::try_from(dims.as_slice()) {
                Ok(kernel) => Ok((image, kernel)),
                Err(_) => Err(self.bad(format!("has weights of shape {dims:?}"))),
            },
            other => Err(self.bad(format!("has {other:?} as weights"))),
        }
    }

    fn conv(&self, inputs: &[&Value]) -> Result<Value, ModelError> {
        self.knows(&["dilations", "group", "kernel_shape", "pads", "strides"])?;
        let ([n, channels, rows, columns], [out, per_group, kh, kw]) = self.kernel(inputs)?;
        let group = self.int("group", 1)?;
        let groups = u64::try_from(group).ok().filter(|g| *g > 0 && out.is_multiple_of(*g));
        if groups.and_then(|g| g.checked_mul(per_group)) != Some(channels) {
            return Err(self.bad(format!(
                "has {out} x {per_group} channels in {group} groups for an image of {channels}"
            )));
        }
        if let Some(bias) = inputs.get(2) {
            self.per_channel(bias, out)?;
        }
        let window = self.window(self.sides([kh, kw])?)?;
        let [rows, columns] = self.shrunk([rows, columns], &window)?;
        Ok(Value::Activation([n, out, rows, columns]))
    }

    fn pool(&self, inputs: &[&Value]) -> Result<Value, ModelError> {
        self.knows(&["kernel_shape", "pads", "strides", "ceil_mode", "count_include_pad"])?;
        if self.int("ceil_mode", 0)? != 0 {
            return Err(ModelError::unsupported(format!("ceil_mode of node {}", self.index)));
        }
        let [n, channels, rows, columns] = self.activation(self.only(inputs)?)?;
        let window = self.window(self.extents("kernel_shape", 1, [0; 2])?)?;
        let [rows, columns] = self.shrunk([rows, columns], &window)?;
        Ok(Value::Activation([n, channels, rows, columns]))
    }

    fn conv_transpose(&self, inputs: &[&Value]) -> Result<Value, ModelError> {
        self.knows(&["dilations", "group", "kernel_shape", "pads", "strides", "output_padding"])?;
        let ([n, channels, rows, columns], [taken, out, kh, kw]) = self.kernel(inputs)?;
        if taken != channels || self.int("group", 1)? != 1 {
            return Err(self.bad(format!("takes {taken} channels of an image of {channels}")));
        }
        if let Some(bias) = inputs.get(2) {
            self.per_channel(bias, out)?;
        }
        let window = self.window(self.sides([kh, kw])?)?;
        let extra = self.extents("output_padding", 0, [0; 2])?;
        let mut grown = [0; 2];
        for axis in 0..2 {
            // ONNX, ConvTranspose: s (n - 1) + output_padding + d (k - 1) + 1 - pads.
            let side = self.sides([rows, columns])?[axis];
            let length = window.strides[axis]
                .checked_mul(side - 1)
                .and_then(|l| {
                    l.checked_add(extra[axis] + window.dilations[axis] * (window.kernel[axis] - 1))
                })
                .map(|l| l + 1 - window.pads[axis][0] - window.pads[axis][1]);
            grown[axis] = self.side(length)?;
        }
        Ok(Value::Activation([n, out, grown[0], grown[1]]))
    }

    /// Sides after a window that moves over the image.
    fn shrunk(&self, sides: [u64; 2], window: &Window) -> Result<[u64; 2], ModelError> {
        let sides = self.sides(sides)?;
        let mut shrunk = [0; 2];
        for axis in 0..2 {
            let reach = window.dilations[axis] * (window.kernel[axis] - 1) + 1;
            let room = sides[axis]
                .checked_add(window.pads[axis][0] + window.pads[axis][1])
                .map(|padded| padded - reach)
                .filter(|room| *room >= 0);
            shrunk[axis] = self.side(room.map(|room| room / window.strides[axis] + 1))?;
        }
        Ok(shrunk)
    }

    fn sides(&self, sides: [u64; 2]) -> Result<[i64; 2], ModelError> {
        match (i64::try_from(sides[0]), i64::try_from(sides[1])) {
            (Ok(rows), Ok(columns)) => Ok([rows, columns]),
            _ => Err(self.bad(format!("has sides of {sides:?}"))),
        }
    }

    fn side(&self, length: Option<i64>) -> Result<u64, ModelError> {
        length
            .and_then(|l| u64::try_from(l).ok())
            .filter(|l| *l > 0)
            .ok_or_else(|| self.bad("leaves nothing of the image"))
    }

    fn norm(&self, inputs: &[&Value]) -> Result<Value, ModelError> {
        self.knows(&["epsilon"])?;
        // Two equal pixels of a channel would be divided by 0.
        let epsilon = match self.attribute("epsilon") {
            None => 1e-5,
            Some(a) if a.kind == KIND_FLOAT => a.f,
            Some(_) => f32::NAN,
        };
        let [image, scale, shift] = inputs else {
            return Err(self.bad(format!("has {} inputs; expected 3", inputs.len())));
        };
        if !(epsilon > 0.0) {
            return Err(self.bad(format!("has the epsilon {epsilon}")));
        }
        let dims = self.activation(image)?;
        self.per_channel(scale, dims[1])?;
        self.per_channel(shift, dims[1])?;
        Ok(Value::Activation(dims))
    }

    fn cast(&self, inputs: &[&Value]) -> Result<Value, ModelError> {
        self.knows(&["to"])?;
        let to = self.int("to", 0)?;
        if to != i64::from(FLOAT) {
            return Err(ModelError::unsupported(format!(
                "cast to element type {to} (node {}); known is float32 (1)",
                self.index
            )));
        }
        Ok(match self.only(inputs)? {
            Value::HalfWeights(dims) => Value::Weights(dims.clone()),
            other => other.clone(),
        })
    }

    fn concat(&self, inputs: &[&Value]) -> Result<Value, ModelError> {
        self.knows(&["axis"])?;
        if self.int("axis", i64::MAX)? != 1 || inputs.is_empty() {
            return Err(self.bad("does not join channels"));
        }
        let mut all = self.activation(inputs[0])?;
        for other in &inputs[1..] {
            let [n, channels, rows, columns] = self.activation(other)?;
            if [n, rows, columns] != [all[0], all[2], all[3]] {
                return Err(self.bad(format!(
                    "joins {:?} and {:?}",
                    all,
                    [n, channels, rows, columns]
                )));
            }
            all[1] = all[1].saturating_add(channels);
        }
        Ok(Value::Activation(all))
    }

    fn add(&self, inputs: &[&Value]) -> Result<Value, ModelError> {
        self.knows(&[])?;
        match inputs {
            [a, b] if a == b => Ok(Value::Activation(self.activation(a)?)),
            [a, b] => Err(self.bad(format!("adds {:?} and {:?}", a.dims(), b.dims()))),
            _ => Err(self.bad(format!("has {} inputs; expected 2", inputs.len()))),
        }
    }
}
