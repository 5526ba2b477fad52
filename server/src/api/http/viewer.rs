//! The viewer: the files that `web/` builds, embedded in the program.

use axum::Router;
use axum::http::HeaderMap;
use axum::response::Response;
use axum::routing::get;
use rust_embed::Embed;

use super::files::{self, Keep};

/// The page that loads the other files.
const PAGE: &str = "index.html";
/// Folder of the files whose names change with their content.
pub(in crate::api) const ASSETS: &str = "/assets/";
/// The page may load scripts, pictures and data only from its own server. It compiles WebAssembly,
/// which reads files of motion. The component library sets styles, and dropped files are read as
/// blobs.
const POLICY: &str = "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self' 'unsafe-inline'; \
    img-src 'self' data: blob:; connect-src 'self' blob: data:; worker-src 'self' blob:; frame-ancestors 'none'; \
    base-uri 'none'; form-action 'none'";

#[derive(Embed)]
#[folder = "../web/dist"]
struct Files;

/// A route for each file, and `/` for the page. Nothing is compressed: browsers cache the files,
/// and compressing the script took 49 ms of an I/O thread per request instead of 2.
pub(super) fn router() -> Router {
    let files = Files::iter().filter(|path| path != PAGE).map(|path| {
        let route = format!("/{path}");
        (route, path)
    });
    let page = ("/".to_owned(), PAGE.into());
    std::iter::once(page)
        .chain(files)
        .fold(Router::new(), |router, (route, path)| {
            router.route(
                &route,
                get(move |headers: HeaderMap| async move { file(&path, &headers) }),
            )
        })
}

/// A file of the viewer.
fn file(path: &str, headers: &HeaderMap) -> Response {
    let keep = match path.starts_with(&ASSETS[1..]) {
        true => Keep::Forever,
        false => Keep::Ask,
    };
    files::answer(Files::get(path), headers, keep, POLICY)
}

#[cfg(test)]
mod tests {
    use axum::body::{Body, to_bytes};
    use axum::http::{HeaderValue, Request, StatusCode, header};
    use tower::ServiceExt as _;

    use super::*;

    async fn get(path: &str, known: Option<&HeaderValue>) -> Response {
        let mut request = Request::builder().uri(path);
        if let Some(known) = known {
            request = request.header(header::IF_NONE_MATCH, known);
        }
        router()
            .oneshot(request.body(Body::empty()).unwrap())
            .await
            .unwrap()
    }

    #[tokio::test]
    async fn the_page_and_all_that_it_names_are_there() {
        let page = get("/", None).await;
        assert_eq!(page.status(), StatusCode::OK);
        assert!(
            page.headers()[header::CONTENT_TYPE]
                .to_str()
                .unwrap()
                .starts_with("text/html")
        );
        let again = get("/", Some(&page.headers()[header::ETAG])).await;
        assert_eq!(again.status(), StatusCode::NOT_MODIFIED);
        let text = to_bytes(page.into_body(), 1 << 20).await.unwrap();
        let text = std::str::from_utf8(&text).unwrap();
        let named: Vec<&str> = text.split('"').filter(|part| part.starts_with(ASSETS)).collect();
        assert!(named.iter().any(|path| path.ends_with(".js")), "{text}");
        for path in named {
            let file = get(path, None).await;
            assert_eq!(file.status(), StatusCode::OK, "{path}");
            assert!(
                file.headers()[header::CACHE_CONTROL]
                    .to_str()
                    .unwrap()
                    .contains("immutable")
            );
        }
        assert!(!text.contains("http://") && !text.contains("https://"), "{text}");
    }

    #[tokio::test]
    async fn other_paths_are_not_the_viewers() {
        assert_eq!(get("/assets/none.js", None).await.status(), StatusCode::NOT_FOUND);
    }
}
