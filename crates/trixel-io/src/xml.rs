//! A small XML document in memory, for formats whose elements refer to each other by id or attribute in any order.
//!
//! Own code over `quick-xml` instead of a DOM crate: `roxmltree` keeps for each element every namespace in scope, which
//! a few megabytes of nested declarations turn into gigabytes. Here names lose their prefix, entities other than the
//! predefined ones are refused, and neither building nor dropping the tree recurses; memory is in proportion to the text.

use std::borrow::Cow;
use std::collections::HashMap;

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use crate::read::{Problem, shown};

/// All elements of a document, parents before children.
pub(crate) struct Document<'a> {
    elements: Vec<Data<'a>>,
    ids: HashMap<Cow<'a, str>, usize>,
}

struct Data<'a> {
    tag: BytesStart<'a>,
    /// The text directly in the element, pieces joined.
    text: Cow<'a, str>,
    first_child: Option<usize>,
    next_sibling: Option<usize>,
}

/// One element of a document.
#[derive(Clone, Copy)]
pub(crate) struct Element<'d> {
    document: &'d Document<'d>,
    data: &'d Data<'d>,
    index: usize,
}

impl<'a> Document<'a> {
    /// Parses `text`.
    pub(crate) fn parse(text: &'a str) -> Result<Self, Problem> {
        /// An element that is not closed yet, and its last child.
        struct Open {
            element: usize,
            last_child: Option<usize>,
        }
        let mut reader = Reader::from_str(text);
        let mut elements: Vec<Data<'a>> = Vec::new();
        let mut ids = HashMap::new();
        let mut open: Vec<Open> = Vec::new();
        loop {
            let event = reader.read_event();
            let problem = |what: String| {
                let at = usize::try_from(reader.buffer_position()).unwrap_or(usize::MAX);
                let before = text.as_bytes().get(..at).unwrap_or(text.as_bytes());
                Problem::new(format!("line {}", 1 + before.iter().filter(|&&b| b == b'\n').count()), what)
            };
            let event = event.map_err(|error| problem(format!("{error}; the file is damaged")))?;
            let empty = matches!(event, Event::Empty(_));
            match event {
                Event::Start(tag) | Event::Empty(tag) => {
                    let element = elements.len();
                    match open.last_mut() {
                        Some(parent) => {
                            let link = match parent.last_child.replace(element) {
                                Some(sibling) => elements.get_mut(sibling).map(|data| &mut data.next_sibling),
                                None => elements.get_mut(parent.element).map(|data| &mut data.first_child),
                            };
                            if let Some(link) = link {
                                *link = Some(element);
                            }
                        }
                        None if element > 0 => {
                            return Err(problem("a second root element; the file is damaged".into()));
                        }
                        None => {}
                    }
                    if let Some(id) = attribute(&tag, "id") {
                        // Of elements with the same id the first counts.
                        ids.entry(Cow::Owned(id.into_owned())).or_insert(element);
                    }
                    elements.push(Data { tag, text: Cow::Borrowed(""), first_child: None, next_sibling: None });
                    if !empty {
                        open.push(Open { element, last_child: None });
                    }
                }
                Event::End(_) => drop(open.pop()),
                Event::Text(piece) => append(&mut elements, open.last().map(|o| o.element), piece.into_inner()),
                Event::CData(piece) => append(&mut elements, open.last().map(|o| o.element), piece.into_inner()),
                Event::GeneralRef(reference) => {
                    let text = format!("&{};", &*reference);
                    let Ok(resolved) = quick_xml::escape::unescape(&text) else {
                        return Err(problem(format!("the entity {text} is not known; the file is damaged")));
                    };
                    let resolved = Cow::Owned(resolved.into_owned());
                    append(&mut elements, open.last().map(|o| o.element), resolved);
                }
                Event::Eof if open.is_empty() && !elements.is_empty() => return Ok(Self { elements, ids }),
                Event::Eof => return Err(problem("the XML ends too soon; the file is cut off".into())),
                Event::Comment(_) | Event::Decl(_) | Event::PI(_) | Event::DocType(_) => {}
            }
        }
    }

    /// The root element.
    pub(crate) fn root(&self) -> Option<Element<'_>> {
        self.element(0)
    }

    /// The element that `#id` refers to; other documents are not read.
    pub(crate) fn find(&self, url: &str) -> Option<Element<'_>> {
        self.element(*self.ids.get(url.trim().strip_prefix('#')?)?)
    }

    /// The element whose id is `id`.
    pub(crate) fn by_id(&self, id: &str) -> Option<Element<'_>> {
        self.element(*self.ids.get(id.trim())?)
    }

    /// Every element called `name`, in the order of the document.
    pub(crate) fn all<'d>(&'d self, name: &'d str) -> impl Iterator<Item = Element<'d>> {
        (0..self.elements.len()).filter_map(|i| self.element(i)).filter(move |element| element.name() == name)
    }

    fn element(&self, index: usize) -> Option<Element<'_>> {
        Some(Element { document: self, data: self.elements.get(index)?, index })
    }
}

fn append<'a>(elements: &mut [Data<'a>], element: Option<usize>, piece: Cow<'a, str>) {
    let Some(data) = element.and_then(|element| elements.get_mut(element)) else { return };
    if data.text.is_empty() {
        data.text = piece;
    } else if !piece.trim_ascii().is_empty() || !data.text.trim_ascii().is_empty() {
        data.text.to_mut().push_str(&piece);
    }
}

fn attribute<'t>(tag: &'t BytesStart<'_>, name: &str) -> Option<Cow<'t, str>> {
    let found = tag.attributes().with_checks(false).flatten().find(|attribute| attribute.key.0 == name)?;
    match found.value {
        Cow::Borrowed(value) => quick_xml::escape::unescape(value).ok(),
        Cow::Owned(value) => Some(Cow::Owned(quick_xml::escape::unescape(&value).ok()?.into_owned())),
    }
}

impl<'d> Element<'d> {
    /// A number that no other element of the document has.
    pub(crate) fn index(self) -> usize {
        self.index
    }

    /// The element's name without prefix.
    pub(crate) fn name(self) -> &'d str {
        let name = self.data.tag.name().0;
        name.split_once(':').map_or(name, |(_, local)| local)
    }

    /// The text directly in the element.
    pub(crate) fn text(self) -> &'d str {
        &self.data.text
    }

    /// An attribute without prefix.
    pub(crate) fn attribute(self, name: &str) -> Option<Cow<'d, str>> {
        attribute(&self.data.tag, name)
    }

    /// The element that attribute `name` refers to as `#id`.
    pub(crate) fn target(self, name: &str) -> Option<Element<'d>> {
        self.document.find(&self.attribute(name)?)
    }

    /// The children in order.
    pub(crate) fn children(self) -> impl Iterator<Item = Element<'d>> {
        let first = self.data.first_child.and_then(|i| self.document.element(i));
        std::iter::successors(first, |child| self.document.element(child.data.next_sibling?))
    }

    /// The children called `name`.
    pub(crate) fn all<'n>(self, name: &'n str) -> impl Iterator<Item = Element<'d>> + use<'d, 'n> {
        let first = self.data.first_child.and_then(|i| self.document.element(i));
        let document = self.document;
        std::iter::successors(first, move |child| document.element(child.data.next_sibling?))
            .filter(move |child| child.name() == name)
    }

    /// The first child called `name`.
    pub(crate) fn child(self, name: &str) -> Option<Element<'d>> {
        self.children().find(|child| child.name() == name)
    }

    /// The element for messages: its name, and its id or where it is used.
    pub(crate) fn describe(self) -> String {
        match self.attribute("id").or_else(|| self.attribute("name")) {
            Some(id) => format!("<{} id=\"{id}\">", self.name()),
            None => format!("<{}>", self.name()),
        }
    }

    /// A problem in this element.
    pub(crate) fn problem(self, what: impl Into<String>) -> Problem {
        Problem::new(self.describe(), what)
    }

    /// The numbers in the element's text.
    pub(crate) fn numbers(self) -> Result<Vec<f64>, Problem> {
        let number = |token: &str| {
            let bad = || self.problem(format!("'{}' is not a number; the file is damaged", shown(token.as_bytes())));
            token.parse::<f64>().map_err(|_| bad())
        };
        self.text().split_ascii_whitespace().map(number).collect()
    }

    /// The indices in the element's text; negative ones, which mean "none", become `u32::MAX`.
    pub(crate) fn indices(self) -> Result<Vec<u32>, Problem> {
        let index = |token: &str| {
            let bad = || self.problem(format!("'{}' is not an index; the file is damaged", shown(token.as_bytes())));
            token.parse::<i64>().map(|i| u32::try_from(i).unwrap_or(u32::MAX)).map_err(|_| bad())
        };
        self.text().split_ascii_whitespace().map(index).collect()
    }

    /// An attribute that is a whole number, or `default` where it is missing.
    pub(crate) fn integer(self, name: &str, default: usize) -> Result<usize, Problem> {
        let Some(value) = self.attribute(name) else { return Ok(default) };
        let bad = || self.problem(format!("{name}=\"{}\" is not a whole number", shown(value.as_bytes())));
        value.trim().parse().map_err(|_| bad())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lose_their_prefix_and_text_is_joined() {
        let document =
            Document::parse("<?xml version=\"1.0\"?><a:b><c id=\"1\">x<!-- y -->&amp;<![CDATA[<z>]]></c><d/></a:b>");
        let document = document.unwrap();
        let root = document.root().unwrap();
        assert_eq!((root.name(), root.child("c").unwrap().text()), ("b", "x&<z>"));
        assert_eq!(root.children().map(Element::name).collect::<Vec<_>>(), ["c", "d"]);
        assert_eq!(document.find("#1").unwrap().name(), "c");
    }

    #[test]
    fn what_is_not_well_formed_is_refused() {
        for text in ["", "<a>", "<a></b>", "<a/><b/>", "<a>&unknown;</a>", "</a>", "text", "<a", "<a><![CDATA["] {
            assert!(Document::parse(text).is_err(), "{text}");
        }
    }

    /// Each level declares a namespace: a tree that lists for each element those in scope takes memory for 2^31 of them.
    #[test]
    fn nested_namespaces_take_memory_in_proportion() {
        let levels = 1 << 16;
        let mut text: String = (0..levels).map(|i| format!("<a xmlns:n{i}=\"u{i}\">")).collect();
        text.extend((0..levels).map(|_| "</a>"));
        let document = Document::parse(&text).unwrap();
        assert_eq!(document.all("a").count(), levels);
    }
}
