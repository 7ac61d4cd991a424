//! Where the bytes of a glTF document lie: the GLB container, data URIs, files beside the document.

use std::borrow::Cow;
use std::collections::HashMap;
use std::rc::Rc;

use base64::Engine;
use base64::alphabet;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

use super::json::Document;
use crate::read::text::without_byte_order_mark;
use crate::read::{Problem, Resources};

/// The JSON of a document and, for GLB, the bytes that come with it.
pub(super) struct Container<'a> {
    pub(super) json: &'a [u8],
    pub(super) binary: Option<&'a [u8]>,
    pub(super) warnings: Vec<String>,
}

impl<'a> Container<'a> {
    /// Takes GLB apart; anything that does not begin with its magic is JSON.
    pub(super) fn open(bytes: &'a [u8]) -> Result<Self, Problem> {
        if !bytes.starts_with(b"glTF") {
            let json = without_byte_order_mark(bytes);
            return Ok(Self { json, binary: None, warnings: Vec::new() });
        }
        let mut warnings = Vec::new();
        let (Some(version), Some(length)) = (word(bytes, 4), word(bytes, 8)) else {
            return Err(Problem::new("byte 4", "the GLB header is cut off; copy the file again"));
        };
        if version != 2 {
            return Err(Problem::new(
                "byte 4",
                format!("this is GLB version {version}, and only version 2 is read; export it as glTF 2.0"),
            ));
        }
        let Some(whole) = bytes.get(..length as usize) else {
            return Err(Problem::new(
                "byte 8",
                format!(
                    "the header says {length} bytes, but the file has {}: it is cut off; copy it again",
                    bytes.len()
                ),
            ));
        };
        if whole.len() < bytes.len() {
            warnings.push(format!("{} bytes after the end of the GLB data are ignored", bytes.len() - whole.len()));
        }
        let (mut json, mut binary) = (None, None);
        let mut at = 12;
        while at < whole.len() {
            let (Some(length), Some(kind)) = (word(whole, at), word(whole, at + 4)) else {
                return Err(Problem::new(format!("byte {at}"), "a chunk's header is cut off; copy the file again"));
            };
            let start = at + 8;
            let Some(chunk) = start.checked_add(length as usize).and_then(|end| whole.get(start..end)) else {
                return Err(Problem::new(
                    format!("byte {at}"),
                    format!(
                        "a chunk of {length} bytes does not fit into the {} that are left; copy the file again",
                        whole.len() - start
                    ),
                ));
            };
            match (kind, at) {
                (JSON, 12) => json = Some(chunk),
                (JSON, _) | (_, 12) => {
                    return Err(Problem::new(
                        format!("byte {at}"),
                        "the JSON chunk must be the first and only one of its kind; export the file again",
                    ));
                }
                (BIN, _) if binary.is_none() => binary = Some(chunk),
                _ => {}
            }
            at = start + chunk.len();
        }
        let Some(json) = json else {
            return Err(Problem::new("byte 12", "there is no JSON chunk; the file is cut off"));
        };
        Ok(Self { json, binary, warnings })
    }
}

const JSON: u32 = 0x4e4f_534a;
const BIN: u32 = 0x004e_4942;

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?))
}

/// The buffers that accessors and images use, each loaded once.
pub(super) struct Buffers<'a> {
    document: &'a Document<'a>,
    loaded: Vec<Result<Bytes<'a>, Problem>>,
    total: usize,
}

#[derive(Clone)]
enum Bytes<'a> {
    Borrowed(&'a [u8]),
    Shared(Rc<Vec<u8>>),
}

impl Bytes<'_> {
    fn as_slice(&self) -> &[u8] {
        match self {
            Self::Borrowed(bytes) => bytes,
            Self::Shared(bytes) => bytes,
        }
    }
}

impl<'a> Buffers<'a> {
    /// Loads what is used. A buffer that fails does so when it is asked for, so that one that only holds animations, or
    /// only images when these are not wanted, does no harm.
    pub(super) fn load(
        document: &'a Document<'a>,
        binary: Option<&'a [u8]>,
        images: bool,
        resources: &dyn Resources,
    ) -> Self {
        let mut used = vec![false; document.buffers.len()];
        let accessors = document.accessors.iter().flat_map(|a| {
            let sparse = a.sparse.iter().flat_map(|s| [s.indices.buffer_view, s.values.buffer_view]);
            a.buffer_view.into_iter().chain(sparse)
        });
        let images = document.images.iter().filter(|_| images).filter_map(|image| image.buffer_view);
        for view in accessors.chain(images).filter_map(|view| document.buffer_views.get(view)) {
            if let Some(used) = used.get_mut(view.buffer) {
                *used = true;
            }
        }
        let mut files: HashMap<Cow<'_, str>, Rc<Vec<u8>>> = HashMap::new();
        let mut total = 0usize;
        let loaded = document.buffers.iter().enumerate().map(|(i, buffer)| {
            let at = format!("buffer {i}");
            if !used.get(i).is_some_and(|&used| used) {
                return Err(Problem::new(at, "not loaded"));
            }
            let bytes = match &buffer.uri {
                None if i == 0 && binary.is_some() => Bytes::Borrowed(binary.unwrap_or_default()),
                None => {
                    return Err(Problem::new(
                        at,
                        "has no data: neither a URI nor a binary chunk; if the file uses a compression extension, \
                         export it without",
                    ));
                }
                Some(uri) => match data_uri(&uri.0, &at)? {
                    Some(bytes) => {
                        total = total.saturating_add(bytes.len());
                        Bytes::Shared(Rc::new(bytes))
                    }
                    None => {
                        let path = relative_path(&uri.0, &at)?;
                        let bytes = match files.get(&path) {
                            Some(bytes) => Rc::clone(bytes),
                            None => {
                                let bytes = resources.load(&path).map_err(|error| {
                                    Problem::new(
                                        &at,
                                        format!("cannot read '{path}': {error}; it belongs beside the file"),
                                    )
                                })?;
                                total = total.saturating_add(bytes.len());
                                let bytes = Rc::new(bytes);
                                files.insert(path, Rc::clone(&bytes));
                                bytes
                            }
                        };
                        Bytes::Shared(bytes)
                    }
                },
            };
            if bytes.as_slice().len() < buffer.byte_length {
                return Err(Problem::new(
                    at,
                    format!(
                        "should have {} bytes but has {}: it is cut off; copy it again",
                        buffer.byte_length,
                        bytes.as_slice().len()
                    ),
                ));
            }
            Ok(bytes)
        });
        let loaded = loaded.collect();
        Self { document, loaded, total }
    }

    /// How many bytes were loaded, without the binary chunk.
    pub(super) fn total(&self) -> usize {
        self.total
    }

    /// The bytes of a buffer view and its stride.
    pub(super) fn view(&self, index: usize, at: &str) -> Result<(&[u8], Option<usize>), Problem> {
        let Some(view) = self.document.buffer_views.get(index) else {
            return Err(Problem::new(at, format!("names bufferView {index}, which does not exist")));
        };
        if view.extensions.meshopt.is_some() {
            return Err(Problem::new(
                format!("bufferView {index}"),
                "is compressed with EXT_meshopt_compression, which is not supported; export without it",
            ));
        }
        let buffer = match self.loaded.get(view.buffer) {
            None => {
                return Err(Problem::new(
                    format!("bufferView {index}"),
                    format!("names buffer {}, which does not exist", view.buffer),
                ));
            }
            Some(Err(problem)) => return Err(problem.clone()),
            Some(Ok(bytes)) => bytes.as_slice(),
        };
        let end = view.byte_offset.checked_add(view.byte_length);
        let Some(bytes) = end.and_then(|end| buffer.get(view.byte_offset..end)) else {
            return Err(Problem::new(
                format!("bufferView {index}"),
                format!(
                    "spans {} bytes from byte {}, but buffer {} has {}; the file is damaged",
                    view.byte_length,
                    view.byte_offset,
                    view.buffer,
                    buffer.len()
                ),
            ));
        };
        Ok((bytes, view.byte_stride))
    }
}

/// The bytes of a `data:` URI, or `None` when `uri` is none.
pub(super) fn data_uri(uri: &str, at: &str) -> Result<Option<Vec<u8>>, Problem> {
    let Some((scheme, rest)) = uri.split_at_checked(5) else { return Ok(None) };
    if !scheme.eq_ignore_ascii_case("data:") {
        return Ok(None);
    }
    let Some((kind, data)) = rest.split_once(',') else {
        return Err(Problem::new(at, "its data URI has no ',' before the data"));
    };
    if !kind.ends_with(";base64") {
        return Ok(Some(percent_encoding::percent_decode_str(data).collect()));
    }
    const FORGIVING: GeneralPurposeConfig = GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true);
    let engine = GeneralPurpose::new(&alphabet::STANDARD, FORGIVING);
    let decoded = engine.decode(data.trim_ascii());
    decoded.map(Some).map_err(|error| Problem::new(at, format!("its data URI is not base64: {error}")))
}

/// The path of a file beside the document.
pub(super) fn relative_path<'u>(uri: &'u str, at: &str) -> Result<Cow<'u, str>, Problem> {
    if uri.contains("://") {
        return Err(Problem::new(at, format!("refers to '{uri}'; only files beside the mesh are read: download it")));
    }
    Ok(percent_encoding::percent_decode_str(uri).decode_utf8_lossy())
}
