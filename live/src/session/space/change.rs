//! Packs that come, go, and take the place of others while the server runs.

use std::sync::Arc;

use super::{LoadError, LoadedPack, Shape, Space, SpaceError, Spaces, count_styles, unreadable};

/// Why the packs stay as they are.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ChangeError {
    /// A pack of this name has, or had since the start, another shape. Scenes, uploads and sessions
    /// rely on that.
    #[error("{why}; allowed: what the pack of this name has had since the server's start, or another name")]
    Shape {
        /// What is different, in words.
        why: String,
    },
    /// The files of a tenant cannot be read.
    #[error(transparent)]
    Space(#[from] SpaceError),
    /// The object definitions of the pack cannot be read.
    #[error(transparent)]
    Definitions(#[from] LoadError),
}

impl Spaces {
    /// Checks that a pack has the shape of the one of its name that is, or was, served. Check this
    /// before its networks are loaded.
    ///
    /// # Errors
    /// [`ChangeError::Shape`].
    pub fn check_shape(&self, pack: &troupe_engine::pack::Pack) -> Result<(), ChangeError> {
        let known = self.making().get(pack.name()).cloned();
        let served = self
            .common
            .packs
            .table()
            .get(pack.name())
            .map(|loaded| Shape::of(&loaded.pack));
        let mut shapes = known.into_iter().chain(served);
        let why = shapes.find_map(|shape| shape.difference(pack));
        why.map_or(Ok(()), |why| Err(ChangeError::Shape { why }))
    }

    /// Serves a pack to all tenants. If there is one of its name, it takes that one's place: new
    /// requests get it, and live sessions make their next plans with it. Returns the one before.
    /// Reads files of tenants, which blocks.
    ///
    /// # Errors
    /// [`ChangeError`]. Then the packs are as before.
    pub fn serve(&self, loaded: LoadedPack) -> Result<Option<Arc<LoadedPack>>, ChangeError> {
        self.check_shape(&loaded.pack)?;
        let one = self.making();
        let loaded = Arc::new(loaded);
        let before = self.common.packs.table().get(loaded.pack.name()).cloned();
        let spaces: Vec<Arc<Space>> = self.all().collect();
        // Everything that can fail comes first.
        let mut packs = Vec::with_capacity(spaces.len());
        for space in &spaces {
            packs.push(self.for_space(space, &loaded, before.is_some())?);
            space.store.read_definitions_of(&loaded.pack.rig)?;
        }
        for (space, pack) in spaces.iter().zip(packs) {
            let table = space.packs.table();
            let pack = match table.get(loaded.pack.name()) {
                Some(before) => Arc::new(pack.after(before)),
                None => pack,
            };
            count_styles([&pack], &space.store);
            let common = space.tenant.as_ref().map(|_| &self.common.packs);
            space.packs.serve(table.with(pack), common);
        }
        drop((one, spaces));
        if let Some(uploads) = self.uploads() {
            uploads.pack_came(loaded.pack.name());
        }
        Ok(before)
    }

    /// The pack with the styles of a space. If it takes the place of another, that one has them.
    fn for_space(
        &self,
        space: &Space,
        loaded: &Arc<LoadedPack>,
        takes_place: bool,
    ) -> Result<Arc<LoadedPack>, ChangeError> {
        let Some(tenant) = &space.tenant else {
            return Ok(loaded.clone());
        };
        let folder = match takes_place {
            true => None,
            false => self.folder_of(tenant, "styles"),
        };
        let own = loaded.of_tenant(folder);
        Ok(Arc::new(own.map_err(|error| unreadable(tenant, &error))?))
    }

    /// Serves a pack no more. Its sessions go on with it until they end. Returns it, or none if it
    /// is not served.
    pub fn end(&self, name: &str) -> Option<Arc<LoadedPack>> {
        let mut shapes = self.making();
        let ended = self.common.packs.table().get(name).cloned()?;
        shapes.insert(name.to_owned(), Shape::of(&ended.pack));
        for space in self.all() {
            let common = space.tenant.as_ref().map(|_| &self.common.packs);
            space.packs.serve(space.packs.table().without(name), common);
        }
        Some(ended)
    }
}
