//! The documentation: the site that `make docs` builds, inside the program, where it was built before the program.

use axum::Router;
use axum::extract::Path;
use axum::http::HeaderMap;
use axum::response::{IntoResponse as _, Redirect, Response};
use axum::routing::get;
use rust_embed::Embed;
use tower_http::compression::CompressionLayer;

use super::files::{self, Keep};

/// Where the interactive page of the HTTP interface is.
pub(super) const SWAGGER: &str = "/docs/api";
/// The page of a folder.
const PAGE: &str = "index.html";
/// The generator writes scripts and styles into its pages. Nothing comes from anybody else.
const POLICY: &str = "default-src 'self'; script-src 'self' 'unsafe-inline'; style-src 'self' 'unsafe-inline'; \
    img-src 'self' data:; connect-src 'self'; worker-src 'self' blob:; frame-ancestors 'none'; base-uri 'self'; \
    form-action 'none'";

#[derive(Embed)]
#[folder = "../target/site"]
#[allow_missing = true]
struct Files;

/// The site at `/docs/`. Without one `/docs/` leads to the interactive page.
pub(super) fn router() -> Router {
    let router = Router::new().route("/docs", get(|| async { Redirect::temporary("/docs/") }));
    if Files::get(PAGE).is_none() {
        return router.route("/docs/", get(|| async { Redirect::temporary("/docs/api/") }));
    }
    router
        .route(
            "/docs/",
            get(|headers: HeaderMap| async move { file(PAGE, &headers) }),
        )
        .route(
            "/docs/{*path}",
            get(|Path(path): Path<String>, headers: HeaderMap| async move { file(&path, &headers) }),
        )
        .layer(CompressionLayer::new())
}

/// A file of the site. A folder's page is at the folder's name and a slash, so that its links lead on from there.
fn file(path: &str, headers: &HeaderMap) -> Response {
    if path.ends_with('/') {
        return files::answer(Files::get(&format!("{path}{PAGE}")), headers, Keep::Ask, POLICY);
    }
    let found = Files::get(path);
    if found.is_none() && Files::get(&format!("{path}/{PAGE}")).is_some() {
        return Redirect::temporary(&format!("/docs/{path}/")).into_response();
    }
    files::answer(found, headers, Keep::Ask, POLICY)
}

#[cfg(test)]
mod tests {
    use axum::body::Body;
    use axum::http::{Request, StatusCode, header};
    use tower::ServiceExt as _;

    use super::*;

    async fn get(path: &str) -> Response {
        let request = Request::builder().uri(path).body(Body::empty()).unwrap();
        router().oneshot(request).await.unwrap()
    }

    #[tokio::test]
    async fn the_site_or_the_interactive_page_is_there() {
        assert_eq!(get("/docs").await.headers()[header::LOCATION], "/docs/");
        let answer = get("/docs/").await;
        if Files::get(PAGE).is_none() {
            assert_eq!(answer.headers()[header::LOCATION], "/docs/api/");
            return;
        }
        assert_eq!(answer.status(), StatusCode::OK);
        assert_eq!(answer.headers()[header::CONTENT_SECURITY_POLICY], POLICY);
        assert_eq!(get("/docs/none.html").await.status(), StatusCode::NOT_FOUND);
        let folder = get("/docs/decisions").await;
        assert_eq!(folder.headers()[header::LOCATION], "/docs/decisions/");
        assert_eq!(get("/docs/decisions/").await.status(), StatusCode::OK);
    }
}
