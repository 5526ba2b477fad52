//! Parts of XML and meshes.

use glam::DVec3;
use roxmltree::Node;

use super::DescriptionError;

/// Most triangles of a mesh.
const MAX_TRIANGLES: usize = 2_000_000;
/// Bytes before a binary STL's triangles, and of each of them.
const STL_HEADER: usize = 84;
const STL_TRIANGLE: usize = 50;

/// An error about an element.
pub(super) fn element_error(element: Node<'_, '_>, reason: &str) -> DescriptionError {
    let position = element.document().text_pos_at(element.range().start);
    let tag = element.tag_name().name();
    let name = element
        .attribute("name")
        .or_else(|| element.parent()?.attribute("name"));
    DescriptionError::Element {
        line: position.row,
        what: format!("{tag} {}", name.unwrap_or("without a name")),
        reason: reason.to_owned(),
    }
}

/// The first child with a tag.
pub(super) fn child<'a, 'input>(element: Node<'a, 'input>, tag: &str) -> Option<Node<'a, 'input>> {
    element.children().find(|node| node.has_tag_name(tag))
}

/// The numbers of an attribute.
pub(super) fn numbers<const N: usize>(
    element: Node<'_, '_>,
    attribute: &str,
    default: &str,
) -> Result<[f64; N], DescriptionError> {
    let text = element.attribute(attribute).unwrap_or(default);
    let found: Option<Vec<f64>> = text
        .split_whitespace()
        .map(|word| word.parse().ok().filter(|number: &f64| number.is_finite()))
        .collect();
    found
        .and_then(|found| <[f64; N]>::try_from(found).ok())
        .ok_or_else(|| {
            element_error(
                element,
                &format!("{attribute} {text:?} must be {N} finite numbers"),
            )
        })
}

/// The corners of a binary STL's triangles; none for another file.
pub(super) fn stl_points(bytes: &[u8]) -> Option<Vec<DVec3>> {
    let count = u32::from_le_bytes(bytes.get(80..STL_HEADER)?.try_into().ok()?) as usize;
    if !(1..=MAX_TRIANGLES).contains(&count) || bytes.len() < STL_HEADER + STL_TRIANGLE * count {
        return None;
    }
    let triangles = bytes[STL_HEADER..].chunks_exact(STL_TRIANGLE).take(count);
    let number = |bytes: &[u8]| f64::from(f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]));
    let corners = triangles.flat_map(|triangle| triangle[12..48].chunks_exact(12));
    let points = corners.map(|c| DVec3::new(number(c), number(&c[4..]), number(&c[8..])));
    let points: Vec<DVec3> = points.collect();
    points.iter().all(|point| point.is_finite()).then_some(points)
}
