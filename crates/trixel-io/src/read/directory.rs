//! Files beside a mesh, found by the relative path that the mesh file writes.

use std::cell::RefCell;
use std::collections::HashMap;
use std::ffi::{OsStr, OsString};
use std::io::{Error, ErrorKind, Result};
use std::path::{Component, Path, PathBuf};

use super::Resources;

/// The folder that a mesh file lies in.
pub(super) struct Directory {
    folder: PathBuf,
    /// The names in the folders looked into, by folder and lower case: a file may name thousands that are not there.
    listings: RefCell<HashMap<PathBuf, HashMap<OsString, OsString>>>,
}

impl Directory {
    /// The folder of the mesh file at `path`.
    pub(super) fn of(path: &Path) -> Self {
        Self { folder: path.parent().map(Path::to_owned).unwrap_or_default(), listings: RefCell::default() }
    }

    /// The file that `relative` names, which may be in a folder beside or above, as exporters write `../textures/a.png`.
    fn find(&self, relative: &str) -> Result<PathBuf> {
        let mut path = self.folder.clone();
        for component in Path::new(&checked(relative)?).components() {
            match component {
                Component::Normal(name) => path = self.entry(&path, name),
                Component::ParentDir => path.push(".."),
                _ => {}
            }
        }
        let kind = std::fs::metadata(&path)?;
        // Devices and pipes may never end.
        if kind.is_file() { Ok(path) } else { Err(Error::new(ErrorKind::InvalidInput, "not a regular file")) }
    }

    /// `folder/name`, or the entry of `folder` that differs from it only in case: many files were written where case
    /// does not matter. Of several, the first in byte order.
    fn entry(&self, folder: &Path, name: &OsStr) -> PathBuf {
        let exact = folder.join(name);
        if exact.exists() {
            return exact;
        }
        let mut listings = self.listings.borrow_mut();
        let listing = listings.entry(folder.to_owned()).or_insert_with(|| list(folder));
        listing.get(&name.to_ascii_lowercase()).map_or(exact, |found| folder.join(found))
    }
}

impl Resources for Directory {
    fn load(&self, relative: &str) -> Result<Vec<u8>> {
        std::fs::read(self.find(relative)?)
    }

    fn locate(&self, relative: &str) -> Option<PathBuf> {
        self.find(relative).ok()
    }
}

/// No files at all, for a mesh that is only bytes in memory.
pub(super) struct Nowhere;

impl Resources for Nowhere {
    fn load(&self, _relative: &str) -> Result<Vec<u8>> {
        Err(Error::new(ErrorKind::NotFound, "a mesh read from memory has no files beside it"))
    }

    fn locate(&self, _relative: &str) -> Option<PathBuf> {
        None
    }
}

/// The names in a folder by their lower case; none if it cannot be read.
fn list(folder: &Path) -> HashMap<OsString, OsString> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<OsString> = entries.map(|entry| entry.file_name()).collect();
    // The first in byte order comes last, and so replaces the others.
    names.sort_unstable_by(|a, b| b.cmp(a));
    names.into_iter().map(|name| (name.to_ascii_lowercase(), name)).collect()
}

/// The relative path with `/` between its parts, or why a mesh may not refer to it.
fn checked(relative: &str) -> Result<String> {
    let refused = |why| Err(Error::new(ErrorKind::InvalidInput, why));
    let path = relative.replace('\\', "/");
    let scheme = path.split('/').next().is_some_and(|first| first.contains(':'));
    if path.is_empty() {
        refused("the file name is empty")
    } else if path.contains('\0') {
        refused("the file name contains a zero byte")
    } else if scheme || path.starts_with('/') {
        refused("only relative paths are followed, no URLs and no absolute paths")
    } else {
        Ok(path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder of its own with `sub/Wood.PNG` in it.
    fn folder(test: &str) -> Directory {
        let folder = std::env::temp_dir().join(format!("trixel-directory-{test}-{}", std::process::id()));
        std::fs::create_dir_all(folder.join("sub")).unwrap();
        std::fs::write(folder.join("sub/Wood.PNG"), b"wood").unwrap();
        Directory::of(&folder.join("mesh.obj"))
    }

    #[test]
    fn finds_by_slash_backslash_and_any_case() {
        let files = folder("find");
        for name in ["sub/Wood.PNG", "sub\\Wood.PNG", "./sub/wood.png", "SUB/WOOD.png", "sub/../sub/Wood.PNG"] {
            assert_eq!(files.load(name).unwrap(), b"wood", "{name}");
            assert!(files.locate(name).is_some(), "{name}");
        }
        std::fs::remove_dir_all(files.folder).unwrap();
    }

    #[test]
    fn refuses_absolute_paths_urls_folders_and_missing_files() {
        let files = folder("refuse");
        let absolute = files.folder.join("sub/Wood.PNG");
        for name in
            [absolute.to_str().unwrap(), "C:\\wood.png", "http://a/b.png", "data:,", "", "sub", "no.png", "a\0b"]
        {
            assert!(files.load(name).is_err(), "{name}");
            assert!(files.locate(name).is_none(), "{name}");
        }
        std::fs::remove_dir_all(files.folder).unwrap();
    }
}
