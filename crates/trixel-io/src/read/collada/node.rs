//! The transforms of COLLADA nodes (COLLADA 1.4.1, chapter 5).

use crate::read::Problem;
use crate::read::transform::Affine;
use crate::xml::Element;

/// All transforms of a node together: the first in the file is applied last.
pub(super) fn transform(node: Element<'_>) -> Result<Affine, Problem> {
    let mut all = Affine::IDENTITY;
    for child in node.children() {
        let one = match child.name() {
            "matrix" => matrix(child)?,
            "translate" => Affine::translation(numbers(child)?),
            "scale" => Affine::scale(numbers(child)?),
            "rotate" => {
                let [x, y, z, degrees] = numbers(child)?;
                rotation([x, y, z], degrees)
            }
            "lookat" => look_at(child)?,
            "skew" => skew(child)?,
            _ => continue,
        };
        all = all.after(&one);
    }
    Ok(all)
}

/// A 4x4 matrix, row by row, whose last row is 0 0 0 1.
pub(super) fn matrix(element: Element<'_>) -> Result<Affine, Problem> {
    let m: [f64; 16] = numbers(element)?;
    Ok(Affine(std::array::from_fn(|row| std::array::from_fn(|column| m[4 * row + column]))))
}

fn numbers<const N: usize>(element: Element<'_>) -> Result<[f64; N], Problem> {
    let numbers = element.numbers()?;
    <[f64; N]>::try_from(numbers)
        .map_err(|n| element.problem(format!("has {} numbers where {N} are needed; the file is damaged", n.len())))
}

fn rotation(axis: [f64; 3], degrees: f64) -> Affine {
    let length = dot(axis, axis).sqrt();
    if length == 0.0 {
        return Affine::IDENTITY;
    }
    let (sin, cos) = sin_cos_degrees(degrees);
    let [x, y, z] = axis.map(|c| c / length);
    let t = 1.0 - cos;
    Affine([
        [t * x * x + cos, t * x * y - sin * z, t * x * z + sin * y, 0.0],
        [t * x * y + sin * z, t * y * y + cos, t * y * z - sin * x, 0.0],
        [t * x * z - sin * y, t * y * z + sin * x, t * z * z + cos, 0.0],
    ])
}

/// Exact for quarter turns, which are most of what files hold.
fn sin_cos_degrees(degrees: f64) -> (f64, f64) {
    let turned = degrees.rem_euclid(360.0);
    if turned == 0.0 {
        (0.0, 1.0)
    } else if turned == 90.0 {
        (1.0, 0.0)
    } else if turned == 180.0 {
        (0.0, -1.0)
    } else if turned == 270.0 {
        (-1.0, 0.0)
    } else {
        degrees.to_radians().sin_cos()
    }
}

/// Stands at the eye and looks along -z at the point of interest.
fn look_at(element: Element<'_>) -> Result<Affine, Problem> {
    let [ex, ey, ez, ix, iy, iz, ux, uy, uz]: [f64; 9] = numbers(element)?;
    let back = unit([ex - ix, ey - iy, ez - iz]);
    let right = unit(cross([ux, uy, uz], back));
    let up = cross(back, right);
    if dot(right, right) == 0.0 {
        return Err(element.problem("looks along its own up axis, or at itself; the file is damaged"));
    }
    let eye = [ex, ey, ez];
    Ok(Affine(std::array::from_fn(|row| [right[row], up[row], back[row], eye[row]])))
}

/// Shears along `translation` so that `rotation` turns by the angle towards it (as RenderMan's `Skew`).
fn skew(element: Element<'_>) -> Result<Affine, Problem> {
    let [degrees, rx, ry, rz, tx, ty, tz]: [f64; 7] = numbers(element)?;
    let along = unit([tx, ty, tz]);
    let turned = [rx, ry, rz];
    let parallel = dot(turned, along);
    let across = unit(std::array::from_fn(|i| turned[i] - parallel * along[i]));
    let square = dot(turned, across);
    let (sin, cos) = sin_cos_degrees(degrees);
    let x = square * cos - parallel * sin;
    let y = square * sin + parallel * cos;
    if square == 0.0 || x <= 0.0 {
        return Err(element.problem("skews by an angle that its axes do not allow; the file is damaged"));
    }
    let shear = y / x - parallel / square;
    Ok(Affine(std::array::from_fn(|row| {
        std::array::from_fn(|column| {
            let identity = if row == column { 1.0 } else { 0.0 };
            if column == 3 { 0.0 } else { identity + shear * along[row] * across[column] }
        })
    })))
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The vector at length 1, or zero when it has no length.
fn unit(v: [f64; 3]) -> [f64; 3] {
    let length = dot(v, v).sqrt();
    if length > 0.0 { v.map(|c| c / length) } else { [0.0; 3] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::xml::Document;

    fn moved(transforms: &str, point: [f64; 3]) -> [f64; 3] {
        let text = format!("<node>{transforms}</node>");
        let document = Document::parse(&text).unwrap();
        transform(document.root().unwrap()).unwrap().point(point)
    }

    fn assert_near(a: [f64; 3], b: [f64; 3]) {
        assert!((0..3).all(|i| (a[i] - b[i]).abs() < 1e-14), "{a:?} is not {b:?}");
    }

    #[test]
    fn first_transform_is_applied_last() {
        let both = "<translate>1 0 0</translate><scale>2 2 2</scale>";
        assert_eq!(moved(both, [1.0, 1.0, 1.0]), [3.0, 2.0, 2.0]);
    }

    #[test]
    fn quarter_turns_are_exact() {
        assert_eq!(moved("<rotate>0 0 1 90</rotate>", [1.0, 0.0, 0.0]), [0.0, 1.0, 0.0]);
        assert_eq!(moved("<rotate>0 0 2 -90</rotate>", [1.0, 0.0, 0.0]), [0.0, -1.0, 0.0]);
        assert_near(moved("<rotate>1 0 0 45</rotate>", [0.0, 1.0, 0.0]), [0.0, 0.5f64.sqrt(), 0.5f64.sqrt()]);
    }

    #[test]
    fn matrix_is_row_by_row() {
        assert_eq!(moved("<matrix>1 0 0 5 0 1 0 6 0 0 1 7 0 0 0 1</matrix>", [0.0; 3]), [5.0, 6.0, 7.0]);
    }

    #[test]
    fn lookat_puts_minus_z_on_the_interest() {
        assert_near(moved("<lookat>5 0 0  0 0 0  0 1 0</lookat>", [0.0, 0.0, -5.0]), [0.0; 3]);
        assert_near(moved("<lookat>5 0 0  0 0 0  0 1 0</lookat>", [0.0, 2.0, -5.0]), [0.0, 2.0, 0.0]);
    }

    #[test]
    fn skew_turns_one_axis_towards_the_other() {
        assert_near(moved("<skew>45 0 1 0 1 0 0</skew>", [0.0, 1.0, 0.0]), [1.0, 1.0, 0.0]);
    }

    #[test]
    fn wrong_counts_and_impossible_axes_are_problems() {
        for bad in [
            "<translate>1 2</translate>",
            "<matrix>1</matrix>",
            "<lookat>0 0 0 0 0 0 0 1 0</lookat>",
            "<skew>90 0 1 0 1 0 0</skew>",
            "<rotate>a b c d</rotate>",
        ] {
            let text = format!("<node>{bad}</node>");
            let document = Document::parse(&text).unwrap();
            assert!(transform(document.root().unwrap()).is_err(), "{bad}");
        }
    }
}
