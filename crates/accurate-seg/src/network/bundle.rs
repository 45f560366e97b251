use std::fmt;

use bytes::Bytes;

use super::ModelError;
use super::manifest::{MAX_MANIFEST_BYTES, Manifest};
use super::onnx_check::{Contract, NetworkFacts, check_network};

/// A model that passed every check: description, network, and what is known of both.
///
/// # Format
/// One file, `.accmodel`, all numbers little-endian:
///
/// | bytes | contents |
/// |---|---|
/// | 8 | `ACCMODEL` |
/// | 4 | format, 1 |
/// | 4 | length of the description, m |
/// | 8 | length of the network, n |
/// | 32 | BLAKE3 of everything after this field |
/// | m | description, JSON ([`Manifest`]) |
/// | n | network, ONNX with all weights inside |
///
/// Nothing follows. Reading it takes no memory besides the file.
#[derive(Clone)]
pub struct ModelBundle {
    manifest: Manifest,
    network: Bytes,
    facts: NetworkFacts,
    hash: String,
}

const MAGIC: &[u8; 8] = b"ACCMODEL";
const FORMAT: u32 = 1;
const HEADER: usize = 56;
/// Largest network, bytes: three times the widest U-Net that nnU-Net plans for images of 512 px.
pub const MAX_NETWORK_BYTES: u64 = 512 << 20;
/// Largest bundle, bytes.
pub const MAX_MODEL_BYTES: u64 = MAX_NETWORK_BYTES + MAX_MANIFEST_BYTES + HEADER as u64;

impl ModelBundle {
    /// Reads a bundle and checks all of it.
    ///
    /// # Errors
    /// [`ModelError`]: not a bundle, another format, truncated or longer than it says, damaged, a
    /// bad description, or a network that cannot be run ([`ModelBundle::new`]).
    ///
    /// # Cost
    /// One pass over the file for the hash and one over the weights.
    pub fn read(file: Bytes) -> Result<Self, ModelError> {
        let found = file.len() as u64;
        if found > MAX_MODEL_BYTES {
            let what = "model in bytes";
            return Err(ModelError::TooLarge { what, found, limit: MAX_MODEL_BYTES });
        }
        if !file.starts_with(MAGIC) {
            let found = file.iter().take(MAGIC.len()).copied().collect();
            return Err(ModelError::NotAModel { found });
        }
        let short = ModelError::WrongLength { expected: HEADER as u64, found };
        let header = file.get(..HEADER).ok_or(short)?;
        let format = u32::from_le_bytes(field(header, 8));
        if format != FORMAT {
            return Err(ModelError::UnknownFormat { found: format, known: FORMAT });
        }
        let manifest_length = u64::from(u32::from_le_bytes(field(header, 12)));
        let network_length = u64::from_le_bytes(field(header, 16));
        for (what, found, limit) in [
            ("model description in bytes", manifest_length, MAX_MANIFEST_BYTES),
            ("network in bytes", network_length, MAX_NETWORK_BYTES),
        ] {
            if found > limit {
                return Err(ModelError::TooLarge { what, found, limit });
            }
        }
        let expected = HEADER as u64 + manifest_length + network_length;
        if expected != found {
            return Err(ModelError::WrongLength { expected, found });
        }
        let expected = blake3::Hash::from_bytes(field(header, 24));
        let actual = blake3::hash(&file[HEADER..]);
        if actual != expected {
            let (expected, found) = (expected.to_hex().to_string(), actual.to_hex().to_string());
            return Err(ModelError::WrongHash { expected, found });
        }
        // Both lengths passed their limits, far below usize::MAX.
        let split = HEADER + manifest_length as usize;
        let manifest = Manifest::from_json(&file[HEADER..split])?;
        Self::new(manifest, file.slice(split..))
    }

    /// Puts a description and a network together, if they belong together.
    ///
    /// # Errors
    /// [`ModelError::BadManifest`], and for the network [`ModelError::NotOnnx`],
    /// [`ModelError::Unsupported`] (external data, operations other than those of U-Nets),
    /// [`ModelError::BadNetwork`] (names or shapes that are not the description's),
    /// [`ModelError::NotFinite`], [`ModelError::TooLarge`].
    pub fn new(manifest: Manifest, network: Bytes) -> Result<Self, ModelError> {
        manifest.check()?;
        let found = network.len() as u64;
        if found > MAX_NETWORK_BYTES {
            let what = "network in bytes";
            return Err(ModelError::TooLarge { what, found, limit: MAX_NETWORK_BYTES });
        }
        let spec = &manifest.network;
        let contract = Contract {
            input: &spec.input,
            output: &spec.output,
            classes: spec.classes.into(),
            multiple_px: spec.multiple_px.into(),
        };
        let facts = check_network(&network, &contract)?;
        if let Some(size) = facts.fixed_size
            && (manifest.tiling.window_px.map(u64::from) != size
                || manifest.tiling.whole_up_to_px != 0)
        {
            return Err(ModelError::BadManifest {
                message: format!(
                    "{:?} for a network that reads {size:?} px and nothing else",
                    manifest.tiling
                ),
            });
        }
        let (_, hash) = serialise(&manifest, &network)?;
        Ok(Self { manifest, network, facts, hash })
    }

    /// The bundle as a file.
    ///
    /// # Errors
    /// [`ModelError::TooLarge`] for a description above its limit.
    pub fn to_bytes(&self) -> Result<Vec<u8>, ModelError> {
        let (json, _) = serialise(&self.manifest, &self.network)?;
        let mut file = Vec::with_capacity(HEADER + json.len() + self.network.len());
        file.extend(MAGIC);
        file.extend(FORMAT.to_le_bytes());
        file.extend((json.len() as u32).to_le_bytes());
        file.extend((self.network.len() as u64).to_le_bytes());
        file.extend([0; 32]);
        file.extend(&json);
        file.extend(&self.network);
        let hash = blake3::hash(&file[HEADER..]);
        file[24..HEADER].copy_from_slice(hash.as_bytes());
        Ok(file)
    }

    /// The description.
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// The network, ONNX.
    pub fn network(&self) -> &Bytes {
        &self.network
    }

    /// What the check has learnt about the network.
    pub fn facts(&self) -> &NetworkFacts {
        &self.facts
    }

    /// BLAKE3 of description and network, hexadecimal: the model's identity.
    pub fn hash(&self) -> &str {
        &self.hash
    }
}

impl fmt::Debug for ModelBundle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ModelBundle")
            .field("manifest", &self.manifest)
            .field("facts", &self.facts)
            .field("hash", &self.hash)
            .finish_non_exhaustive()
    }
}

/// The description as JSON, and the hash of what a file holds after its header.
fn serialise(manifest: &Manifest, network: &[u8]) -> Result<(Vec<u8>, String), ModelError> {
    let json = serde_json::to_vec(manifest)
        .map_err(|error| ModelError::BadManifest { message: error.to_string() })?;
    let found = json.len() as u64;
    if found > MAX_MANIFEST_BYTES {
        let what = "model description in bytes";
        return Err(ModelError::TooLarge { what, found, limit: MAX_MANIFEST_BYTES });
    }
    let mut hasher = blake3::Hasher::new();
    hasher.update(&json);
    hasher.update(network);
    Ok((json, hasher.finalize().to_hex().to_string()))
}

/// `N` bytes of the header, which has at least [`HEADER`].
fn field<const N: usize>(header: &[u8], from: usize) -> [u8; N] {
    let mut bytes = [0; N];
    for (to, byte) in bytes.iter_mut().zip(header.iter().skip(from)) {
        *to = *byte;
    }
    bytes
}
