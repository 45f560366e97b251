use std::fmt;
use std::sync::Arc;
use std::thread::{self, ScopedJoinHandle};

use ndarray::{Array2, Array3};
use prost::Message;
use rten::{Model, ModelOptions, NodeId, RunOptions, ThreadPool, ValueOrView};
use rten_tensor::Tensor;
use rten_tensor::prelude::*;

use super::convolution::Convolution;
use super::convolution_plan::{PlannedConvolution, needs, plan};
use super::onnx_proto::ModelProto;
use super::{Engine, ModelBundle, ModelError};
use crate::SegError;

const NAME: &str = "rten 0.27";

/// The engine in pure Rust: nothing to install.
///
/// rten runs the network but for its convolutions: it gathers their pixels one by one, which takes twice as
/// long as the rest. They are matrix products of faer.
pub struct RtenEngine {
    model: Model,
    /// The image and what each of the convolutions makes, in order.
    known: Vec<NodeId>,
    /// The convolutions, each with what it takes.
    convolutions: Vec<(Convolution, Vec<Target>)>,
    output: Target,
    threads: usize,
    pool: Arc<ThreadPool>,
}

/// A value that rten is asked for.
struct Target {
    node: NodeId,
    /// Which of the known values are enough for it, and whether nothing later takes them.
    needs: Vec<(usize, bool)>,
}

/// The known values that something still takes.
type Values = Vec<Option<Tensor<f32>>>;

impl RtenEngine {
    /// Prepares the network of a bundle for `threads` threads, at least 1.
    ///
    /// # Errors
    /// [`ModelError::Engine`].
    ///
    /// # Cost
    /// The weights are held in float32, twice.
    pub fn new(bundle: &ModelBundle, threads: usize) -> Result<Self, ModelError> {
        let refuse = |message: String| ModelError::Engine { engine: NAME, message };
        let model = ModelOptions::with_all_ops()
            .load(bundle.network().to_vec())
            .map_err(|error| refuse(error.to_string()))?;
        let graph = ModelProto::decode(bundle.network().clone())
            .map_err(|error| ModelError::NotOnnx { message: error.to_string() })?
            .graph
            .unwrap_or_default();
        let spec = &bundle.manifest().network;
        let node = |name: &str| model.node_id(name).map_err(|error| refuse(error.to_string()));

        let mut known = vec![spec.input.as_str()];
        let mut names = Vec::new();
        let mut ready = Vec::new();
        let planned = plan(&graph);
        for planned in &planned {
            // What rten has made something else of stays with it.
            if let Some(convolution) = prepared(&model, planned) {
                known.push(&planned.output);
                names.extend(planned.inputs.iter().map(String::as_str));
                ready.push((convolution, planned.inputs.len()));
            }
        }
        names.push(&spec.output);
        let mut targets = Vec::new();
        for (name, needs) in names.iter().zip(needs(&graph, &known, &names)) {
            targets.push(Target { node: node(name)?, needs });
        }
        let known = known.into_iter().map(node).collect::<Result<_, _>>()?;
        let mut targets = targets.into_iter();
        let convolutions = ready
            .into_iter()
            .map(|(convolution, inputs)| (convolution, targets.by_ref().take(inputs).collect()))
            .collect();
        let output = targets.next().ok_or_else(|| refuse("it has no output".to_owned()))?;
        let threads = threads.max(1);
        let pool = Arc::new(ThreadPool::with_num_threads(threads));
        Ok(Self { model, known, convolutions, output, threads, pool })
    }

    fn run(&self, image: Tensor<f32>) -> Result<Tensor<f32>, String> {
        let mut values = vec![Some(image)];
        for (convolution, targets) in &self.convolutions {
            let inputs = targets
                .iter()
                .map(|target| self.value(target, &mut values))
                .collect::<Result<Vec<_>, _>>()?;
            values.push(Some(self.convolved(convolution, &inputs)?));
        }
        self.value(&self.output, &mut values)
    }

    fn convolved(
        &self,
        convolution: &Convolution,
        inputs: &[Tensor<f32>],
    ) -> Result<Tensor<f32>, String> {
        let shapes: Vec<_> = inputs.iter().map(|input| input.shape().to_vec()).collect();
        let images: Option<Vec<_>> = inputs.iter().map(Tensor::data).collect();
        let sides = shapes[0].get(2..4).map(|sides| [sides[0], sides[1]]);
        let (Some(images), Some(sides)) = (images, sides) else {
            return Err(format!("a convolution of values of shape {shapes:?}"));
        };
        let channels: usize = shapes.iter().map(|shape| shape[1]).sum();
        let alike = shapes.iter().all(|shape| shape[..] == [1, shape[1], sides[0], sides[1]]);
        if !alike || channels != convolution.inputs() || sides.contains(&0) {
            return Err(format!("a convolution of values of shape {shapes:?}"));
        }
        let (output, [rows, columns]) = self.pool.run(|| convolution.apply(&images, sides));
        let channels = output.len() / (rows * columns);
        Ok(Tensor::from_data(&[1, channels, rows, columns], output))
    }

    /// By rten. Known values that nothing later takes are given up for it.
    fn value(&self, target: &Target, values: &mut Values) -> Result<Tensor<f32>, String> {
        let given: Vec<_> = target
            .needs
            .iter()
            .map(|&(k, is_last)| if is_last { values[k].take() } else { None })
            .collect();
        let mut inputs: Vec<(NodeId, ValueOrView<'_>)> = Vec::new();
        for (given, &(k, _)) in given.into_iter().zip(&target.needs) {
            let is_target = self.known[k] == target.node;
            match (given, &values[k]) {
                (Some(value), _) if is_target => return Ok(value),
                (None, Some(value)) if is_target => return Ok(value.clone()),
                (Some(value), _) => inputs.push((self.known[k], value.into())),
                (None, Some(value)) => inputs.push((self.known[k], value.into())),
                (None, None) => return Err(format!("value {k} is gone")),
            }
        }
        let options = RunOptions::default().with_thread_pool(Some(self.pool.clone()));
        let [output] = self
            .model
            .run_n(inputs, [target.node], Some(options))
            .map_err(|error| error.to_string())?;
        output.into_tensor::<f32>().ok_or_else(|| "a value is not float32".to_owned())
    }
}

/// A convolution with its tensors as rten has them.
fn prepared(model: &Model, planned: &PlannedConvolution) -> Option<Convolution> {
    let tensor = |name: &str| {
        let [value] = model.run_n(Vec::new(), [model.node_id(name).ok()?], None).ok()?;
        value.into_tensor::<f32>()
    };
    let mut names = planned.inputs.iter().chain([&planned.output]);
    if !names.all(|name| model.node_id(name).is_ok()) {
        return None;
    }
    let weights = tensor(&planned.weights)?;
    let bias = match &planned.bias {
        Some(name) => Some(tensor(name)?.into_data()),
        None => None,
    };
    let &[outputs, inputs, side, _] = weights.shape() else { return None };
    let shape = [outputs, inputs, side];
    Convolution::new(&weights.into_data(), bias.as_deref(), shape, planned.stride)
}

impl Engine for RtenEngine {
    fn logits(&self, input: &Array2<f32>) -> Result<Array3<f32>, SegError> {
        let refuse = |message: String| SegError::Engine { engine: self.describe(), message };
        let (height, width) = input.dim();
        let image =
            Tensor::from_data(&[1, 1, height, width], input.iter().copied().collect::<Vec<_>>());
        // On a thread of its own, which only waits: a worker of the caller's pool would begin other
        // work of its pool meanwhile, the next image, and the next within that one.
        let ran = thread::scope(|scope| {
            thread::Builder::new()
                .spawn_scoped(scope, || self.run(image))
                .map(ScopedJoinHandle::join)
        });
        let output = ran
            .map_err(|error| refuse(format!("no thread for it: {error}")))?
            .map_err(|_| refuse("it panicked".to_owned()))?
            .map_err(refuse)?;
        let shape = output.shape().to_vec();
        let [1, classes, rows, columns] = shape[..] else {
            return Err(refuse(format!("output of shape {shape:?}")));
        };
        Array3::from_shape_vec((classes, rows, columns), output.into_data())
            .map_err(|error| refuse(error.to_string()))
    }

    fn describe(&self) -> String {
        NAME.to_owned()
    }
}

impl fmt::Debug for RtenEngine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RtenEngine").field("threads", &self.threads).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::super::Manifest;
    use super::super::onnx_proto::NodeProto;
    use super::*;

    /// What rten would compute instead takes twice as long and says nothing.
    #[test]
    fn all_convolutions_of_the_built_in_network_are_matrix_products_and_skips_are_not_copied() {
        let bundle = include_bytes!("../../../../models/wire.accmodel");
        let bundle = ModelBundle::read(bundle.as_slice().into()).unwrap();
        let engine = RtenEngine::new(&bundle, 1).unwrap();
        let graph = ModelProto::decode(bundle.network().clone()).unwrap().graph.unwrap();
        let count = |kind: &str| graph.node.iter().filter(|node| node.op_type == kind).count();
        assert_eq!(engine.convolutions.len(), count("Conv"));
        let of_two = engine.convolutions.iter().filter(|(_, inputs)| inputs.len() == 2).count();
        assert_eq!(of_two, count("Concat"));
        // Values are given up: only the last one that takes each is told so.
        let targets = engine.convolutions.iter().flat_map(|(_, inputs)| inputs);
        let all: Vec<_> = targets.chain([&engine.output]).flat_map(|t| &t.needs).collect();
        for k in 0..engine.known.len() {
            let uses: Vec<_> =
                all.iter().filter(|(of, _)| *of == k).map(|(_, last)| last).collect();
            assert!(!uses.is_empty() && uses.iter().filter(|last| ***last).count() == 1, "{k}");
            assert!(*uses[uses.len() - 1], "{k}");
        }
    }

    /// The network with a copy of every value that a convolution or a concatenation takes, and of what it
    /// gives.
    fn with_copies(network: &[u8], output: &str) -> Vec<u8> {
        let mut model = ModelProto::decode(network).unwrap();
        let graph = model.graph.as_mut().unwrap();
        let mut nodes = Vec::new();
        let copy = |from: &str, to: &str| NodeProto {
            op_type: "Identity".to_owned(),
            input: vec![from.to_owned()],
            output: vec![to.to_owned()],
            ..NodeProto::default()
        };
        for mut node in std::mem::take(&mut graph.node) {
            let values = match node.op_type.as_str() {
                "Conv" => 1,
                "Concat" => node.input.len(),
                _ => 0,
            };
            for (k, name) in node.input.iter_mut().take(values).enumerate() {
                let copied = format!("{name}_copied_{}_{k}", nodes.len());
                nodes.push(copy(name, &copied));
                *name = copied;
            }
            let gives = node.output[0] == output;
            if gives {
                node.output[0] = "original".to_owned();
            }
            nodes.push(node);
            if gives {
                nodes.push(copy("original", output));
            }
        }
        graph.node = nodes;
        model.encode_to_vec()
    }

    #[test]
    fn copies_of_values_change_nothing() {
        for network in [
            &include_bytes!("../../tests/fixtures/unet.onnx")[..],
            &include_bytes!("../../tests/fixtures/dark.onnx")[..],
        ] {
            let manifest = include_bytes!("../../tests/fixtures/dark.json");
            let manifest = Manifest::from_json(manifest).unwrap();
            let copied = with_copies(network, &manifest.network.output);
            let image = Array2::from_shape_fn((16, 24), |(y, x)| ((7 * y + 3 * x) % 11) as f32);
            let [plain, copied] = [network.to_vec(), copied].map(|network| {
                let bundle = ModelBundle::new(manifest.clone(), network.into()).unwrap();
                let engine = RtenEngine::new(&bundle, 1).unwrap();
                (engine.convolutions.len(), engine.logits(&image).unwrap())
            });
            assert!(plain.0 > 0);
            assert_eq!(plain, copied);
        }
    }

    /// Two ways of summing 2,304 products at most round differently, and thirty layers hand it on.
    const ROUNDING: f32 = 1e-3;

    #[test]
    fn it_gives_what_rten_alone_does() {
        let bundle = include_bytes!("../../../../models/wire.accmodel");
        let bundle = ModelBundle::read(bundle.as_slice().into()).unwrap();
        let engine = RtenEngine::new(&bundle, 2).unwrap();
        let mut alone = RtenEngine::new(&bundle, 2).unwrap();
        alone.known.truncate(1);
        alone.convolutions.clear();
        alone.output.needs = vec![(0, true)];
        let body = |y: f32, x: f32| {
            if (y - 100.0 - 40.0 * (x / 50.0).sin()).abs() < 1.5 { -3.0 } else { 0.0 }
        };
        let noise = |y: usize, x: usize| ((31 * y + 17 * x) % 23) as f32 / 23.0;
        let image =
            Array2::from_shape_fn((256, 512), |(y, x)| body(y as f32, x as f32) + noise(y, x));
        let [found, expected] = [&engine, &alone].map(|engine| engine.logits(&image).unwrap());
        let largest = expected.iter().fold(0.0_f32, |most, v| most.max(v.abs()));
        let off = found.iter().zip(&expected).fold(0.0_f32, |most, (a, b)| most.max((a - b).abs()));
        assert!(largest > 5.0 && off < ROUNDING * largest, "{off} of {largest}");
    }
}
