//! Why there can be no picture, in the kinds that the page has words for.

use wasm_bindgen::JsValue;

/// A kind of failure with the details.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// `server-gone`, `empty-scene`, `no-adapter`, `device-lost` or `failed`.
    pub kind: &'static str,
    /// What exactly happened.
    pub message: String,
}

impl Failure {
    /// Of a kind.
    pub fn new(kind: &'static str, message: impl Into<String>) -> Self {
        Self { kind, message: message.into() }
    }

    /// `{kind, message}`.
    pub fn into_js(self) -> JsValue {
        let error = js_sys::Error::new(&self.message);
        // Setting a property of a fresh object does not fail.
        let _ = js_sys::Reflect::set(&error, &"kind".into(), &self.kind.into());
        error.into()
    }
}

/// The text of whatever JavaScript threw.
pub fn text_of(error: &JsValue) -> String {
    error.as_string().unwrap_or_else(|| js_sys::Object::from(error.clone()).to_string().into())
}
