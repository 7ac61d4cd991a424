use trixel::Mesh;

use super::{Loaded, Problem, ReadOptions, Resources};

pub(super) fn read(bytes: &[u8], options: &ReadOptions, resources: &dyn Resources) -> Result<Loaded, Problem> {
    let _ = (bytes, options, resources, Mesh::default());
    Err(Problem::new("start", "not implemented"))
}
