//! The ZIP package of a 3MF file: parts by name, and no more of them than an honest file holds.

use std::io::{self, BufReader, Cursor, Read};

use quick_xml::Reader;
use quick_xml::events::Event;
use zip::result::ZipError;
use zip::{CompressionMethod, ZipArchive};

use crate::read::Problem;

/// How much a package may expand to, over its own size. Deflate packs at most 1032-fold and real models 5- to 30-fold;
/// what is beyond is a bomb. Parts that overlap in the package count each time they are read.
const MOST_EXPANSION: u64 = 200;

/// What even the smallest package may expand to.
const SMALLEST_LIMIT: u64 = 1 << 20;

/// A 3MF package.
pub(super) struct Package<'a> {
    archive: ZipArchive<Cursor<&'a [u8]>>,
    limit: u64,
    expanded: u64,
}

impl<'a> Package<'a> {
    pub(super) fn open(bytes: &'a [u8]) -> Result<Self, Problem> {
        let archive = ZipArchive::new(Cursor::new(bytes)).map_err(|error| {
            Problem::new("package", format!("no readable ZIP archive ({error}); the file is cut off or no 3MF"))
        })?;
        let size = u64::try_from(bytes.len()).unwrap_or(u64::MAX);
        Ok(Self { archive, limit: size.saturating_mul(MOST_EXPANSION).max(SMALLEST_LIMIT), expanded: 0 })
    }

    /// How many bytes were expanded so far.
    pub(super) fn expanded(&self) -> usize {
        usize::try_from(self.expanded).unwrap_or(usize::MAX)
    }

    /// The name of the part that holds the build, as the package's relationships say, or else where it always is.
    pub(super) fn root_model(&mut self) -> Result<String, Problem> {
        const USUAL: &str = "3D/3dmodel.model";
        if self.find("_rels/.rels").is_none() {
            return Ok(USUAL.into());
        }
        let mut reader = Reader::from_reader(self.part("_rels/.rels")?);
        let mut buffer = Vec::new();
        loop {
            buffer.clear();
            match reader.read_event_into(&mut buffer) {
                Ok(Event::Eof) => return Ok(USUAL.into()),
                Ok(Event::Start(element) | Event::Empty(element)) => {
                    let (mut kind, mut target) = (String::new(), None);
                    for attribute in element.attributes().with_checks(false).flatten() {
                        let value = quick_xml::escape::unescape(&attribute.value).unwrap_or_default().into_owned();
                        match attribute.key.0 {
                            "Type" => kind = value,
                            "Target" => target = Some(value),
                            _ => {}
                        }
                    }
                    if let (true, Some(target)) = (kind.ends_with("/3dmodel"), target) {
                        return Ok(part_name(&target));
                    }
                }
                Ok(_) => {}
                Err(error) => return Err(Problem::new("_rels/.rels", format!("{error}; the file is damaged"))),
            }
        }
    }

    /// Opens a part to be read as it expands.
    pub(super) fn part(&mut self, name: &str) -> Result<BufReader<impl Read + '_>, Problem> {
        let Some(index) = self.find(name) else {
            return Err(Problem::new(name, "is not in the package; the file is damaged or no 3MF"));
        };
        let damaged = |error: ZipError| Problem::new(name, format!("{error}; the file is damaged, or encrypted"));
        let part = self.archive.by_index(index).map_err(damaged)?;
        let method = part.compression();
        if !matches!(method, CompressionMethod::Stored | CompressionMethod::Deflated) {
            return Err(Problem::new(
                name,
                format!("is compressed with {method}, which 3MF does not allow; pack the file again with deflate"),
            ));
        }
        Ok(BufReader::with_capacity(1 << 16, Limited { part, limit: self.limit, expanded: &mut self.expanded }))
    }

    /// A whole part.
    pub(super) fn bytes(&mut self, name: &str) -> Result<Vec<u8>, Problem> {
        let mut bytes = Vec::new();
        let read = self.part(name)?.read_to_end(&mut bytes);
        read.map_err(|error| Problem::new(name, error.to_string()))?;
        Ok(bytes)
    }

    /// Part names do not tell upper from lower case (Open Packaging Conventions).
    fn find(&self, name: &str) -> Option<usize> {
        self.archive.index_for_name(name).or_else(|| {
            let same = |stored: &[u8]| stored.eq_ignore_ascii_case(name.as_bytes());
            self.archive.file_names_raw().position(same)
        })
    }
}

/// The name in the archive of the part that a path in the package names.
pub(super) fn part_name(path: &str) -> String {
    percent_encoding::percent_decode_str(path.trim_start_matches('/')).decode_utf8_lossy().into_owned()
}

/// Reads a part until the package has expanded to more than it may.
struct Limited<'p, R> {
    part: R,
    limit: u64,
    expanded: &'p mut u64,
}

impl<R: Read> Read for Limited<'_, R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.part.read(buffer)?;
        *self.expanded = self.expanded.saturating_add(u64::try_from(read).unwrap_or(u64::MAX));
        if *self.expanded > self.limit {
            return Err(io::Error::other(format!(
                "the package expands to more than {} bytes, {MOST_EXPANSION} times its size; it is made to exhaust memory",
                self.limit
            )));
        }
        Ok(read)
    }
}
