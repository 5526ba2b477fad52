//! Metrics of the service: whether it is ready, its scenes, uploads.

use std::sync::Arc;

use troupe_base::telemetry::{Counter, Gauge, Labels, Metric, Telemetry};
use troupe_live::session::Spaces;

const READY: Metric = Metric::new("troupe_ready", "1 if the server takes requests, else 0");
const SCENES: Metric = Metric::new("troupe_scenes", "Number of scenes");
const SCENE_MEMORY: Metric = Metric::new(
    "troupe_scene_memory_bytes",
    "Estimated memory of all scenes: colliders and objects",
);
const UPLOADS: Metric = Metric::new(
    "troupe_uploads_total",
    "Styles, scenes, object definitions and skeletons that were uploaded, by kind",
);

/// The metrics of a service.
#[derive(Debug)]
pub(crate) struct ServiceMetrics {
    ready: Gauge,
    scenes: Gauge,
    scene_memory: Gauge,
    pub(crate) styles_uploaded: Counter,
    pub(crate) scenes_uploaded: Counter,
    pub(crate) objects_uploaded: Counter,
    pub(crate) skeletons_uploaded: Counter,
}

impl ServiceMetrics {
    pub(crate) fn new(telemetry: &Telemetry) -> Self {
        let none = Labels::default();
        let uploads = |kind| telemetry.counter(&UPLOADS, &none.with("kind", kind));
        Self {
            ready: telemetry.gauge(&READY, &none),
            scenes: telemetry.gauge(&SCENES, &none),
            scene_memory: telemetry.gauge(&SCENE_MEMORY, &none),
            styles_uploaded: uploads("style"),
            scenes_uploaded: uploads("scene"),
            objects_uploaded: uploads("object"),
            skeletons_uploaded: uploads("skeleton"),
        }
    }

    /// Updates the metrics that no event updates.
    pub(crate) fn look(&self, ready: bool, spaces: Option<&Arc<Spaces>>) {
        self.ready.set(f64::from(u8::from(ready)));
        let (mut count, mut bytes) = (0, 0);
        for space in spaces.into_iter().flat_map(|spaces| spaces.all()) {
            let scenes = space.store.scenes().all();
            count += scenes.len();
            bytes += scenes.values().map(|cell| cell.snapshot().bytes()).sum::<usize>();
        }
        self.scenes.set(count as f64);
        self.scene_memory.set(bytes as f64);
    }
}
