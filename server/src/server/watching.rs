//! Watches the folder of packs: loads, swaps and unloads packs as folders come, change and go.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use tokio::task::spawn_blocking;
use troupe_proto::v1;

use super::folder::{Provider, Seen};
use troupe_service::{Service, ServiceError, by_age};

/// A folder's pack, by name and version.
type Named = (String, String);

/// What a change of the folder asks for.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Order {
    /// A folder is new or has changed.
    Put(Named),
    /// A folder is gone. The versions of its pack in other folders are left.
    Gone(Named, Vec<String>),
    /// A folder has changed, and its manifest cannot be read.
    Unreadable(PathBuf),
}

/// The folders that have been acted on, and those that still change.
#[derive(Debug)]
struct Watched {
    known: BTreeMap<PathBuf, Seen>,
    /// As the last look saw them.
    last: BTreeMap<PathBuf, Seen>,
}

impl Watched {
    /// Starts with folders that need nothing.
    fn new(known: BTreeMap<PathBuf, Seen>) -> Self {
        Self {
            last: known.clone(),
            known,
        }
    }

    /// What is to be done, now that the folders are `now`. A folder counts once two looks have seen
    /// the same files, because copying takes time.
    fn orders(&mut self, now: BTreeMap<PathBuf, Seen>) -> Vec<Order> {
        let mut orders = Vec::new();
        let is_settled = |folder: &PathBuf| self.last.get(folder) == now.get(folder);
        let mut known = BTreeMap::new();
        for (folder, seen) in &now {
            let before = self.known.get(folder);
            if before == Some(seen) || !is_settled(folder) {
                known.extend(before.map(|before| (folder.clone(), before.clone())));
                continue;
            }
            known.insert(folder.clone(), seen.clone());
            orders.push(match &seen.offer {
                Some(offer) => Order::Put((offer.name.clone(), offer.version.clone())),
                None => Order::Unreadable(folder.clone()),
            });
        }
        let gone = self.known.iter().filter(|(folder, _)| !now.contains_key(*folder));
        for (folder, seen) in gone {
            if !is_settled(folder) {
                known.insert(folder.clone(), seen.clone());
                continue;
            }
            let Some(offer) = &seen.offer else { continue };
            let offers = now.values().filter_map(|seen| seen.offer.as_ref());
            let left = offers.filter(|other| other.name == offer.name);
            let left = left.map(|other| other.version.clone()).collect();
            orders.push(Order::Gone((offer.name.clone(), offer.version.clone()), left));
        }
        self.known = known;
        self.last = now;
        orders
    }
}

/// Watches the folders of `provider` until it is dropped. It looks at them `every` so often.
pub(super) async fn watch(service: Arc<Service>, provider: Arc<dyn Provider>, every: Duration) {
    let look = || {
        let provider = provider.clone();
        async move {
            let looked = spawn_blocking(move || provider.look()).await;
            looked.unwrap_or_else(|error| Err(error.to_string()))
        }
    };
    // Folders that change while the server starts may be missed: they count from the first look on.
    let mut watched = look().await.ok().map(Watched::new);
    let mut is_lost = false;
    loop {
        tokio::time::sleep(every).await;
        let now = match look().await {
            Ok(now) => now,
            Err(error) => {
                // A disk that is away for a moment takes no pack with it.
                if !std::mem::replace(&mut is_lost, true) {
                    tracing::warn!(error, "the folder of packs cannot be watched; the packs stay");
                }
                continue;
            }
        };
        if std::mem::take(&mut is_lost) {
            tracing::info!("the folder of packs is watched again");
        }
        let watched = watched.get_or_insert_with(|| Watched::new(now.clone()));
        for order in watched.orders(now) {
            follow(&service, order).await;
        }
    }
}

/// Follows an order. The service logs and counts what it does, and what it refuses.
async fn follow(service: &Service, order: Order) {
    let Ok(table) = service.table() else {
        return;
    };
    let served = |name: &str| table.get(name).map(|loaded| loaded.pack.manifest.version.clone());
    let result: Result<v1::PackChange, ServiceError> = match order {
        Order::Unreadable(folder) => {
            let folder = folder.display();
            return tracing::warn!(%folder, "a pack.toml cannot be read; the packs stay");
        }
        Order::Put((name, version)) => match served(&name) {
            None => service.load_pack(v1::LoadPackRequest { name, version }).await,
            Some(there) if by_age(&there, &version).is_gt() => {
                return tracing::info!(
                    pack = name,
                    version,
                    there,
                    "a folder has an older version; it is left alone"
                );
            }
            Some(_) => service.swap_pack(v1::SwapPackRequest { name, version }).await,
        },
        Order::Gone((name, version), left) => {
            if served(&name).as_ref() != Some(&version) || left.contains(&version) {
                return;
            }
            match left.is_empty() {
                true => service.unload_pack(v1::UnloadPackRequest { name, version }).await,
                // The newest that is left.
                false => {
                    let version = String::new();
                    service.swap_pack(v1::SwapPackRequest { name, version }).await
                }
            }
        }
    };
    // The log has the reason.
    drop(result);
}

#[cfg(test)]
mod tests {
    use super::*;
    use troupe_service::Offer;

    fn seen(name: &str, version: &str, bytes: u64) -> Seen {
        Seen {
            print: vec![("root.onnx".into(), bytes, None)],
            offer: Some(Offer {
                name: name.to_owned(),
                version: version.to_owned(),
                folder: PathBuf::from(name),
            }),
        }
    }

    fn folders(all: &[(&str, Seen)]) -> BTreeMap<PathBuf, Seen> {
        all.iter()
            .map(|(folder, seen)| (PathBuf::from(folder), seen.clone()))
            .collect()
    }

    fn named(name: &str, version: &str) -> Named {
        (name.to_owned(), version.to_owned())
    }

    #[test]
    fn a_folder_counts_once_it_has_settled() {
        let first = folders(&[("a", seen("a", "1", 5))]);
        let mut watched = Watched::new(first.clone());
        assert_eq!(watched.orders(first.clone()), []);
        let copying = folders(&[("a", seen("a", "1", 5)), ("b", seen("b", "1", 1))]);
        assert_eq!(watched.orders(copying), []);
        let copied = folders(&[("a", seen("a", "1", 5)), ("b", seen("b", "1", 9))]);
        assert_eq!(watched.orders(copied.clone()), []);
        assert_eq!(watched.orders(copied.clone()), [Order::Put(named("b", "1"))]);
        assert_eq!(watched.orders(copied), []);
        // A file of the first was written again.
        let changed = folders(&[("a", seen("a", "1", 6)), ("b", seen("b", "1", 9))]);
        assert_eq!(watched.orders(changed.clone()), []);
        assert_eq!(watched.orders(changed), [Order::Put(named("a", "1"))]);
    }

    #[test]
    fn a_folder_that_is_gone_counts_after_two_looks() {
        let both = folders(&[("a1", seen("a", "1", 5)), ("a2", seen("a", "2", 5))]);
        let one = folders(&[("a1", seen("a", "1", 5))]);
        let mut watched = Watched::new(both.clone());
        assert_eq!(watched.orders(one.clone()), []);
        // It was away for one look.
        assert_eq!(watched.orders(both), []);
        assert_eq!(watched.orders(one.clone()), []);
        let gone = Order::Gone(named("a", "2"), vec!["1".to_owned()]);
        assert_eq!(watched.orders(one.clone()), [gone]);
        assert_eq!(watched.orders(one), []);
    }

    #[test]
    fn a_manifest_that_cannot_be_read_changes_no_pack() {
        let good = folders(&[("a", seen("a", "1", 5))]);
        let broken = Seen {
            offer: None,
            ..seen("a", "1", 3)
        };
        let broken = folders(&[("a", broken)]);
        let mut watched = Watched::new(good.clone());
        assert_eq!(watched.orders(broken.clone()), []);
        assert_eq!(watched.orders(broken.clone()), [Order::Unreadable("a".into())]);
        assert_eq!(watched.orders(broken), []);
        assert_eq!(watched.orders(good.clone()), []);
        assert_eq!(watched.orders(good), [Order::Put(named("a", "1"))]);
    }
}
