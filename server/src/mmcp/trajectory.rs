//! The trajectory of a motion in the protocol's form.

use serde::Serialize;
use serde_json::{Value, json};
use troupe_character::take::{Shape, Trajectory};

/// The field `trajectory` of a sample.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Wire {
    model: &'static str,
    #[serde(rename = "loop")]
    is_loop: bool,
    params: Value,
    heading: &'static str,
    /// World x and z, one per frame, metres.
    position: Vec<[f32; 2]>,
    /// Turn since the first frame, one per frame, radians.
    yaw: Vec<f32>,
}

impl Wire {
    /// The trajectory of a motion, which may be a loop.
    pub fn new(way: Trajectory, is_loop: bool) -> Self {
        let (model, params) = match way.shape {
            Shape::Still => ("still", json!({})),
            Shape::Line {
                heading_deg,
                speed_mps,
            } => ("line", json!({"heading_deg": heading_deg, "speed": speed_mps})),
            Shape::Path { speed_mps } => ("path", json!({"speed": speed_mps})),
        };
        Self {
            model,
            is_loop,
            params,
            heading: if way.is_steady { "fixed" } else { "averaged" },
            position: way.places,
            yaw: way.yaw,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_have_the_protocols_names() {
        let written = |shape, is_steady| {
            let way = Trajectory {
                shape,
                is_steady,
                places: vec![[0.0, 1.0]],
                yaw: vec![0.0],
            };
            serde_json::to_value(Wire::new(way, true)).unwrap()
        };
        let line = Shape::Line {
            heading_deg: 90.0,
            speed_mps: 1.5,
        };
        assert_eq!(
            written(line, true),
            json!({"model": "line", "loop": true, "params": {"heading_deg": 90.0, "speed": 1.5}, "heading": "fixed",
                   "position": [[0.0, 1.0]], "yaw": [0.0]})
        );
        assert_eq!(written(Shape::Still, true)["params"], json!({}));
        let path = written(Shape::Path { speed_mps: 1.0 }, false);
        assert_eq!(
            (&path["model"], &path["heading"]),
            (&json!("path"), &json!("averaged"))
        );
    }
}
