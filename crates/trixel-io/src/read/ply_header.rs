//! The header of a PLY file: which elements follow, with which properties, in which encoding.

use super::Problem;
use super::text::{self, Scanner, shown};

/// More textures than any real file names; each costs a look into the folder and becomes a material.
const MOST_TEXTURES: usize = 4096;

/// The type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn parse(word: &[u8]) -> Option<Self> {
        Some(match word {
            b"char" | b"int8" => Self::I8,
            b"uchar" | b"uint8" => Self::U8,
            b"short" | b"int16" => Self::I16,
            b"ushort" | b"uint16" => Self::U16,
            b"int" | b"int32" => Self::I32,
            b"uint" | b"uint32" => Self::U32,
            b"float" | b"float32" => Self::F32,
            b"double" | b"float64" => Self::F64,
            _ => return None,
        })
    }

    /// Bytes in a binary file.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Scalar(Scalar),
    List { count: Scalar, item: Scalar },
}

#[derive(Debug, PartialEq, Eq)]
pub(super) struct Property<'a> {
    pub(super) name: &'a [u8],
    pub(super) kind: Kind,
}

#[derive(Debug, PartialEq, Eq)]
pub(super) struct Element<'a> {
    pub(super) name: &'a [u8],
    pub(super) count: u64,
    pub(super) properties: Vec<Property<'a>>,
}

impl Element<'_> {
    /// The fewest bytes that one row takes in a binary file; exact when there are no lists.
    pub(super) fn smallest_row(&self) -> usize {
        let size = |property: &Property<'_>| match property.kind {
            Kind::Scalar(scalar) | Kind::List { count: scalar, .. } => scalar.size(),
        };
        self.properties.iter().map(size).sum()
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

#[derive(Debug, PartialEq, Eq)]
pub(super) struct Header<'a> {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element<'a>>,
    /// The file names of `comment TextureFile` lines, at most [`MOST_TEXTURES`].
    pub(super) textures: Vec<String>,
    /// Where the data starts.
    pub(super) end: usize,
}

impl<'a> Header<'a> {
    pub(super) fn parse(bytes: &'a [u8]) -> Result<Self, Problem> {
        let mut scanner = Scanner::new(bytes);
        if scanner.word() != Some(b"ply") {
            return Err(Problem::new("line 1", "a PLY file starts with the line `ply`"));
        }
        // In a file with bare carriage returns, a line feed after the header is the data's first byte.
        let line_feeds = !matches!(scanner.rest(), [b'\r', other, ..] if *other != b'\n');
        let mut encoding = None;
        let mut elements: Vec<Element<'a>> = Vec::new();
        let mut textures = Vec::new();
        loop {
            let keyword = scanner.word().ok_or_else(|| scanner.problem("the header has no `end_header`"))?;
            match keyword {
                b"format" => {
                    encoding = Some(match scanner.word_on_line() {
                        Some(b"ascii") => Encoding::Ascii,
                        Some(b"binary_little_endian") => Encoding::LittleEndian,
                        Some(b"binary_big_endian") => Encoding::BigEndian,
                        other => {
                            let found = shown(other.unwrap_or_default());
                            return Err(scanner.problem(format!("`{found}` is not a PLY format")));
                        }
                    });
                }
                b"comment" if scanner.word_on_line() == Some(b"TextureFile") && textures.len() < MOST_TEXTURES => {
                    textures.push(shown(scanner.rest_of_line()));
                }
                b"element" => {
                    let name = scanner.word_on_line().unwrap_or_default();
                    let count = scanner
                        .count()
                        .ok_or_else(|| scanner.unexpected(&format!("the number of elements `{}`", shown(name))))?;
                    elements.push(Element { name, count, properties: Vec::new() });
                }
                b"property" => {
                    let property = Self::property(&mut scanner)?;
                    match elements.last_mut() {
                        Some(element) => element.properties.push(property),
                        None => return Err(scanner.problem("a `property` before the first `element`")),
                    }
                }
                b"end_header" => break,
                // `obj_info`, and whatever else somebody adds.
                _ => {}
            }
            // Stays before the line's end, so a line without words after its keyword loses nothing.
            scanner.rest_of_line();
        }
        // The data starts right behind the line end: it may itself start with bytes that look like space.
        let padding = scanner.rest().iter().take_while(|&&b| b == b' ' || b == b'\t').count();
        let end = scanner.offset()
            + match scanner.rest().get(padding..) {
                Some([b'\r', b'\n', ..]) if line_feeds => padding + 2,
                Some([b'\r' | b'\n', ..]) => padding + 1,
                _ => 0,
            };
        let encoding = encoding.ok_or_else(|| scanner.problem("the header has no `format` line"))?;
        Ok(Self { encoding, elements, textures, end })
    }

    fn property(scanner: &mut Scanner<'a>) -> Result<Property<'a>, Problem> {
        let scalar = |word: Option<&[u8]>, scanner: &Scanner<'_>| {
            let word = word.unwrap_or_default();
            Scalar::parse(word).ok_or_else(|| scanner.problem(format!("`{}` is not a PLY type", text::shown(word))))
        };
        let kind = match scanner.word_on_line() {
            Some(b"list") => {
                let count = scalar(scanner.word_on_line(), scanner)?;
                let item = scalar(scanner.word_on_line(), scanner)?;
                Kind::List { count, item }
            }
            word => Kind::Scalar(scalar(word, scanner)?),
        };
        Ok(Property { name: scanner.word_on_line().unwrap_or_default(), kind })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_types_and_their_aliases() {
        let names =
            "char uchar short ushort int uint float double int8 uint8 int16 uint16 int32 uint32 float32 float64";
        let mut text = String::from("ply\nformat binary_big_endian 1.0\nobj_info x\nelement vertex 7\n");
        for name in names.split(' ') {
            text += &format!("property {name} p_{name}\n");
        }
        text += "property list uint8 int32 l\nend_header\n";
        let header = Header::parse(text.as_bytes()).unwrap();
        assert_eq!(header.encoding, Encoding::BigEndian);
        assert_eq!(header.end, text.len());
        let element = &header.elements[0];
        assert_eq!(element.count, 7);
        assert_eq!(element.smallest_row(), 2 * (1 + 1 + 2 + 2 + 4 + 4 + 4 + 8) + 1);
        assert_eq!(element.properties[3], Property { name: b"p_ushort", kind: Kind::Scalar(Scalar::U16) });
        assert_eq!(element.properties[16].kind, Kind::List { count: Scalar::U8, item: Scalar::I32 });
    }

    #[test]
    fn data_starts_right_behind_the_line_end() {
        for (text, end) in [
            ("ply\nformat ascii 1.0\nend_header\n\n\n", "ply\nformat ascii 1.0\nend_header\n".len()),
            ("ply\r\nformat ascii 1.0\r\nend_header\r\n\n", "ply\r\nformat ascii 1.0\r\nend_header\r\n".len()),
            ("ply\rformat ascii 1.0\rend_header\r\nx", "ply\rformat ascii 1.0\rend_header\r".len()),
        ] {
            assert_eq!(Header::parse(text.as_bytes()).unwrap().end, end, "{text:?}");
        }
    }

    #[test]
    fn texture_names_may_hold_spaces() {
        let header = Header::parse(b"ply\nformat ascii 1.0\ncomment TextureFile my wood.png \ncomment\nend_header\n");
        assert_eq!(header.unwrap().textures, ["my wood.png"]);
    }

    #[test]
    fn broken_headers_say_what_is_wrong() {
        for (text, message) in [
            ("plx\n", "line 1: a PLY file starts with the line `ply`"),
            ("ply\nformat asci 1.0\n", "line 2: `asci` is not a PLY format"),
            ("ply\nelement vertex -1\n", "line 2: expected the number of elements `vertex`, found `-1`"),
            ("ply\nproperty float x\n", "line 2: a `property` before the first `element`"),
            ("ply\nelement v 1\nproperty list uchar half x\n", "line 3: `half` is not a PLY type"),
            ("ply\nelement v 1\n", "line 3: the header has no `end_header`"),
            ("ply\nend_header\n", "line 2: the header has no `format` line"),
        ] {
            assert_eq!(Header::parse(text.as_bytes()).unwrap_err().to_string(), message);
        }
    }
}
