//! The browser's events into [`Input`]s.

use super::app::App;
use crate::controls::{Grip, Input, Key};
use std::rc::{Rc, Weak};
use wasm_bindgen::prelude::*;
use web_sys::{
    AddEventListenerOptions, Element, Event, EventTarget, HtmlCanvasElement, KeyboardEvent, PointerEvent,
    ResizeObserver, WheelEvent, Window,
};

/// Pixels that a line of `WheelEvent.deltaMode` 1 stands for.
const LINE_PIXELS: f64 = 33.0;
/// Pixels of a page, `deltaMode` 2.
const PAGE_PIXELS: f64 = 600.0;

/// Listens to everything that a person does. The listeners live as long as the page.
pub fn listen(app: &Rc<App>, canvas: &HtmlCanvasElement, window: &Window) -> Result<(), JsValue> {
    let on_canvas: &EventTarget = canvas;
    let target = canvas.clone();
    on(app, on_canvas, "pointerdown", move |app, event: PointerEvent| {
        // So that a drag goes on outside the canvas; a synthetic pointer has nothing to capture.
        let _ = target.set_pointer_capture(event.pointer_id());
        let _ = target.focus();
        let (x, y) = place(&event);
        app.input(Input::Press { id: event.pointer_id(), grip: grip(&event), x, y });
    })?;
    on(app, on_canvas, "pointermove", |app, event: PointerEvent| {
        if event.buttons() != 0 {
            let (x, y) = place(&event);
            app.input(Input::Drag { id: event.pointer_id(), x, y });
        }
    })?;
    for name in ["pointerup", "pointercancel", "lostpointercapture"] {
        on(app, on_canvas, name, |app, event: PointerEvent| {
            app.input(Input::Release { id: event.pointer_id() });
        })?;
    }
    on(app, on_canvas, "contextmenu", |_, event: Event| event.prevent_default())?;
    on(app, on_canvas, "wheel", |app, event: WheelEvent| {
        event.prevent_default();
        let pixels = event.delta_y()
            * match event.delta_mode() {
                WheelEvent::DOM_DELTA_LINE => LINE_PIXELS,
                WheelEvent::DOM_DELTA_PAGE => PAGE_PIXELS,
                _ => 1.0,
            };
        let (x, y) = (f64::from(event.offset_x()), f64::from(event.offset_y()));
        app.input(Input::Wheel { x, y, pixels });
    })?;
    on(app, window, "keydown", |app, event: KeyboardEvent| {
        // Ctrl and Alt belong to the browser, and what is typed into a field to the field.
        if event.ctrl_key() || event.alt_key() || event.meta_key() || is_field(&event) {
            return;
        }
        if let Some(key) = Key::from_names(&event.code(), &event.key()) {
            event.prevent_default();
            if !event.repeat() {
                app.input(Input::KeyDown(key));
            }
        }
    })?;
    on(app, window, "keyup", |app, event: KeyboardEvent| {
        if let Some(key) = Key::from_names(&event.code(), &event.key()) {
            app.input(Input::KeyUp(key));
        }
    })?;
    on(app, window, "blur", |app, _: Event| app.input(Input::Blur))?;
    on(app, window, "hashchange", |app, _: Event| app.follow_address())?;
    let weak = Rc::downgrade(app);
    let resized = Closure::<dyn FnMut()>::new(move || with(&weak, App::canvas_resized));
    ResizeObserver::new(resized.as_ref().unchecked_ref())?.observe(canvas);
    resized.forget();
    Ok(())
}

/// One listener.
fn on<E: JsCast + 'static>(
    app: &Rc<App>,
    target: &EventTarget,
    name: &str,
    handle: impl Fn(&App, E) + 'static,
) -> Result<(), JsValue> {
    let weak = Rc::downgrade(app);
    let closure = Closure::<dyn FnMut(Event)>::new(move |event: Event| {
        with(&weak, |app| handle(app, event.unchecked_into()));
    });
    let options = AddEventListenerOptions::new();
    // A passive listener could not keep the page from scrolling.
    options.set_passive(false);
    target.add_event_listener_with_callback_and_add_event_listener_options(
        name,
        closure.as_ref().unchecked_ref(),
        &options,
    )?;
    closure.forget();
    Ok(())
}

fn with(app: &Weak<App>, work: impl FnOnce(&App)) {
    if let Some(app) = app.upgrade() {
        work(&app);
    }
}

/// Whether the keys go into a field of the panel.
fn is_field(event: &KeyboardEvent) -> bool {
    let element = event.target().and_then(|target| target.dyn_into::<Element>().ok());
    element.is_some_and(|element| ["INPUT", "SELECT", "TEXTAREA"].contains(&element.tag_name().as_str()))
}

/// CSS pixels from the canvas's corner.
fn place(event: &PointerEvent) -> (f64, f64) {
    (f64::from(event.offset_x()), f64::from(event.offset_y()))
}

fn grip(event: &PointerEvent) -> Grip {
    if event.pointer_type() == "touch" {
        Grip::Finger
    } else if event.button() != 0 || event.ctrl_key() {
        Grip::Turn
    } else {
        Grip::Ground
    }
}
