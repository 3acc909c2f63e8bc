//! Resource Timing: what requests were on the wire, told by the browser shortly after they end.

use crate::engine::TileRequest;
use crate::wire_bytes::{WireBytes, body_bytes};
use js_sys::Array;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;
use wasm_bindgen::prelude::*;
use web_sys::{
    PerformanceObserver, PerformanceObserverEntryList, PerformanceObserverInit, PerformanceResourceTiming,
    Url, Window,
};

/// Counts bytes by layer.
pub struct WireLog {
    bytes: Rc<RefCell<WireBytes>>,
    /// `None` in a browser without it: then the bounds count.
    observer: Option<PerformanceObserver>,
}

impl WireLog {
    /// Begins to listen, for as long as the page lives.
    pub fn open() -> Self {
        let bytes = Rc::new(RefCell::new(WireBytes::default()));
        let shared = Rc::clone(&bytes);
        let told = Closure::<dyn FnMut(PerformanceObserverEntryList)>::new(move |list| {
            let list: PerformanceObserverEntryList = list;
            note(&shared, &list.get_entries());
        });
        // An observer of its own sees every entry, however few the page's own buffer keeps.
        let observer = PerformanceObserver::new(told.as_ref().unchecked_ref()).ok();
        if let Some(observer) = &observer {
            observer.observe(&PerformanceObserverInit::new(&Array::of1(&"resource".into())));
        }
        told.forget();
        Self { bytes, observer }
    }

    /// A tile is about to be asked for; gives its address as the browser spells it.
    pub fn asked(&self, window: &Window, request: &TileRequest) -> String {
        let base = window.location().href().unwrap_or_default();
        let address =
            Url::new_with_base(&request.url, &base).map_or_else(|_| request.url.clone(), |url| url.href());
        let now = window.performance().map_or(0.0, |clock| clock.now());
        self.bytes.borrow_mut().asked(address.clone(), request.resource.name(), now);
        address
    }

    /// Its body has come, and was at most so long on the wire; or it has failed.
    pub fn ended(&self, address: &str, bound: Option<u64>) {
        let mut bytes = self.bytes.borrow_mut();
        match bound {
            Some(bound) => bytes.came(address, bound),
            None => bytes.failed(address),
        }
    }

    /// Bytes by layer, by all that the browser has told until now.
    pub fn totals(&self) -> BTreeMap<&'static str, u64> {
        if let Some(observer) = &self.observer {
            note(&self.bytes, &observer.take_records());
        }
        self.bytes.borrow().totals()
    }
}

/// Notes what the browser tells of some requests.
fn note(bytes: &RefCell<WireBytes>, entries: &Array) {
    let mut bytes = bytes.borrow_mut();
    for entry in entries.iter() {
        if let Ok(entry) = entry.dyn_into::<PerformanceResourceTiming>() {
            let size = body_bytes(entry.transfer_size(), entry.encoded_body_size());
            bytes.measured(&entry.name(), entry.start_time(), size);
        }
    }
}
