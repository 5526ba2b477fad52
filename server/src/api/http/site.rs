//! The documentation: the site that `scripts/docs.sh` builds from `docs/`, inside the program if it
//! was built before the program.

use axum::Router;
use axum::extract::Path;
use axum::http::{HeaderMap, HeaderValue, header};
use axum::response::{Html, IntoResponse as _, Redirect, Response};
use axum::routing::get;
use rust_embed::Embed;

use super::files::{self, Keep};

/// Where the interactive page of the HTTP interface is.
pub(super) const SWAGGER: &str = "/docs/api";
/// The page of a folder.
const PAGE: &str = "index.html";
/// What `/docs/` shows if the program was built without the site.
const UNBUILT: &str = include_str!("unbuilt.html");
/// The generator writes scripts and styles into its pages. Nothing comes from anywhere else.
const POLICY: &str = "default-src 'self'; script-src 'self' 'unsafe-inline'; style-src 'self' 'unsafe-inline'; \
    img-src 'self' data:; connect-src 'self'; worker-src 'self' blob:; frame-ancestors 'none'; base-uri 'self'; \
    form-action 'none'";

#[derive(Embed)]
#[folder = "site"]
struct Files;

/// The site at `/docs/`, or how to build it.
pub(super) fn router() -> Router {
    Router::new()
        .route("/docs", get(|| async { Redirect::temporary("/docs/") }))
        .route("/docs/", get(front))
        .route(
            "/docs/{*path}",
            get(|Path(path): Path<String>, headers: HeaderMap| async move { file(&path, &headers) }),
        )
}

/// The first page.
async fn front(headers: HeaderMap) -> Response {
    if Files::get(PAGE).is_some() {
        return file(PAGE, &headers);
    }
    let mut response = Html(UNBUILT).into_response();
    let policy = HeaderValue::from_static(POLICY);
    response
        .headers_mut()
        .insert(header::CONTENT_SECURITY_POLICY, policy);
    response
}

/// A file of the site. A folder's page is at the folder's name and a slash, so that its links lead
/// on from there.
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
    use axum::body::{Body, to_bytes};
    use axum::http::{Request, StatusCode};
    use tower::ServiceExt as _;

    use super::*;

    async fn get(path: &str) -> Response {
        let request = Request::builder().uri(path).body(Body::empty()).unwrap();
        router().oneshot(request).await.unwrap()
    }

    #[tokio::test]
    async fn the_site_is_there_or_how_to_build_it() {
        assert_eq!(get("/docs").await.headers()[header::LOCATION], "/docs/");
        let answer = get("/docs/").await;
        assert_eq!(answer.status(), StatusCode::OK);
        assert_eq!(answer.headers()[header::CONTENT_SECURITY_POLICY], POLICY);
        let text = to_bytes(answer.into_body(), 1 << 20).await.unwrap();
        let text = std::str::from_utf8(&text).unwrap();
        if Files::get(PAGE).is_none() {
            assert!(
                text.contains("make docs") && text.contains(r#"href="/docs/api/""#),
                "{text}"
            );
            return;
        }
        assert!(text.contains("tutorials/first-character.html"), "{text}");
        let folder = get("/docs/decisions").await;
        assert_eq!(folder.headers()[header::LOCATION], "/docs/decisions/");
        for page in [
            "/docs/decisions/",
            "/docs/search.json",
            "/docs/tutorials/first-character.html",
        ] {
            assert_eq!(get(page).await.status(), StatusCode::OK, "{page}");
        }
    }

    #[tokio::test]
    async fn what_the_site_lacks_is_not_found() {
        for path in ["/docs/none.html", "/docs/none/", "/docs/../Cargo.toml"] {
            assert_eq!(get(path).await.status(), StatusCode::NOT_FOUND, "{path}");
        }
    }
}
