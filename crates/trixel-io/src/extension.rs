//! The extensions of file names.

use std::path::Path;

/// Whether the path ends in `.extension` (given in lower case), in upper or lower case.
pub(crate) fn matches(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|found| found.eq_ignore_ascii_case(extension))
}

/// `.a, .b and .c`, for messages.
pub(crate) fn list(extensions: impl IntoIterator<Item = &'static str>) -> String {
    let names: Vec<_> = extensions.into_iter().map(|extension| format!(".{extension}")).collect();
    match names.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} and {last}", rest.join(", ")),
        _ => names.concat(),
    }
}
