//! The documentation at `/docs/`: the site that `make docs` builds, read from a folder. The server
//! can start before the site is built, and shows it as soon as it exists.

use std::path::Path;

use axum::Router;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, Uri, header};
use axum::response::{Html, IntoResponse as _, Redirect, Response};
use axum::routing::get;
use tower::ServiceExt as _;
use tower_http::services::ServeDir;

/// Path of the interactive page for the HTTP interface.
pub(super) const SWAGGER: &str = "/docs/api";
/// The page at `/docs/` while the folder has no site.
const UNBUILT: &str = include_str!("unbuilt.html");
/// The site generator puts scripts and styles inside its pages. All else must come from this
/// server.
const POLICY: &str = "default-src 'self'; script-src 'self' 'unsafe-inline'; style-src 'self' 'unsafe-inline'; \
    img-src 'self' data:; connect-src 'self'; worker-src 'self' blob:; frame-ancestors 'none'; base-uri 'self'; \
    form-action 'none'";

/// The site in `folder`. Without a site: a page that says how to build it.
pub(super) fn router(folder: &Path) -> Router {
    let pages = Router::new()
        .fallback(get(page))
        .with_state(ServeDir::new(folder).append_index_html_on_directories(true));
    Router::new()
        .route("/docs", get(|| async { Redirect::temporary("/docs/") }))
        .nest("/docs/", pages)
}

/// A file of the site. A folder's page is at the folder's name plus a slash, so that its links are
/// relative to the folder.
async fn page(State(files): State<ServeDir>, uri: Uri, request: Request) -> Response {
    let path = uri.path();
    if !path.ends_with('/') && Path::new(path).extension().is_none() {
        return Redirect::temporary(&format!("/docs{path}/")).into_response();
    }
    let mut response = match files.oneshot(request).await {
        Ok(response) if response.status() == StatusCode::NOT_FOUND && path == "/" => {
            Html(UNBUILT).into_response()
        }
        Ok(response) => response.into_response(),
        Err(never) => match never {},
    };
    complete(response.headers_mut());
    response
}

/// Adds the headers that restrict what a browser may do with the file.
fn complete(headers: &mut HeaderMap) {
    // The files are UTF-8. Browsers assume another encoding for text without this.
    let text = headers
        .get(header::CONTENT_TYPE)
        .and_then(|kind| kind.to_str().ok())
        .filter(|kind| kind.starts_with("text/") && !kind.contains("charset"))
        .and_then(|kind| HeaderValue::from_str(&format!("{kind}; charset=utf-8")).ok());
    if let Some(kind) = text {
        headers.insert(header::CONTENT_TYPE, kind);
    }
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-cache"));
    headers.insert(header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(POLICY));
    headers.insert(
        header::X_CONTENT_TYPE_OPTIONS,
        HeaderValue::from_static("nosniff"),
    );
    headers.insert(header::REFERRER_POLICY, HeaderValue::from_static("no-referrer"));
}

#[cfg(test)]
mod tests {
    use axum::body::{Body, to_bytes};
    use axum::http::Request;

    use super::*;

    async fn get(folder: &Path, path: &str) -> Response {
        let request = Request::builder().uri(path).body(Body::empty()).unwrap();
        router(folder).oneshot(request).await.unwrap()
    }

    async fn text(response: Response) -> String {
        let bytes = to_bytes(response.into_body(), 1 << 20).await.unwrap();
        String::from_utf8(bytes.to_vec()).unwrap()
    }

    #[tokio::test]
    async fn a_site_is_shown_as_soon_as_it_is_built() {
        let folder = tempfile::tempdir().unwrap();
        let site = folder.path().join("site");
        assert_eq!(get(&site, "/docs").await.headers()[header::LOCATION], "/docs/");
        let unbuilt = get(&site, "/docs/").await;
        assert_eq!(unbuilt.status(), StatusCode::OK);
        assert_eq!(unbuilt.headers()[header::CONTENT_SECURITY_POLICY], POLICY);
        let unbuilt = text(unbuilt).await;
        assert!(
            unbuilt.contains("make docs") && unbuilt.contains(r#"href="/docs/api/""#),
            "{unbuilt}"
        );

        std::fs::create_dir_all(site.join("decisions")).unwrap();
        std::fs::write(site.join("index.html"), "first page").unwrap();
        std::fs::write(site.join("decisions/index.html"), "decisions").unwrap();
        let front = get(&site, "/docs/").await;
        assert_eq!(front.headers()[header::CONTENT_TYPE], "text/html; charset=utf-8");
        assert_eq!(front.headers()[header::CACHE_CONTROL], "no-cache");
        assert_eq!(text(front).await, "first page");
        let bare = get(&site, "/docs/decisions").await;
        assert_eq!(bare.headers()[header::LOCATION], "/docs/decisions/");
        assert_eq!(text(get(&site, "/docs/decisions/").await).await, "decisions");
    }

    #[tokio::test]
    async fn what_the_site_lacks_is_not_found() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("site")).unwrap();
        std::fs::write(folder.path().join("secret.toml"), "").unwrap();
        for path in [
            "/docs/none.html",
            "/docs/none/",
            "/docs/../secret.toml",
            "/docs/%2e%2e/secret.toml",
            "/docs/..%2fsecret.toml",
        ] {
            let answer = get(&folder.path().join("site"), path).await;
            assert_eq!(answer.status(), StatusCode::NOT_FOUND, "{path}");
        }
    }
}
