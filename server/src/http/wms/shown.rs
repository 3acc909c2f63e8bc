//! LAYERS and STYLES: what a map shows, and in which order.

use super::exception::ServiceException;
use crate::http::layers::{has_layer, layer_names};
use crate::http::query::Parameters;
use crate::recipe::Drawn;
use crate::state::AppState;
use crate::user_error::suggestion;
use treeline_core::layer::Layer;
use treeline_core::query::FILLED_STYLE;

/// The name of every layer's first style.
pub const DEFAULT_STYLE: &str = "default";

/// The layers of a map, the lowest first, as the leftmost of LAYERS is (WMS 1.3.0, 7.3.3.3). One that is named again
/// is drawn once, where it was named last: whatever it hid is hidden by then.
pub fn drawn(app: &AppState, parameters: &Parameters) -> Result<Vec<Drawn>, ServiceException> {
    let layers = layers(app, parameters, "LAYERS")?;
    let styles: Vec<&str> = parameters.get("STYLES").unwrap_or_default().split(',').collect();
    if styles.len() != layers.len() && styles != [""] {
        return Err(ServiceException::new(
            Some("StyleNotDefined"),
            format!(
                "STYLES names {} styles for {} layers; name one for each (or none at all: STYLES=)",
                styles.len(),
                layers.len()
            ),
        ));
    }
    let mut drawn: Vec<Drawn> = Vec::new();
    for (index, &layer) in layers.iter().enumerate() {
        let filled = filled(styles.get(index).copied().unwrap_or_default(), layer)?;
        let this = Drawn { layer, filled };
        drawn.retain(|known| *known != this);
        drawn.push(this);
    }
    if drawn.len() > app.limits.maximum_layers as usize {
        return Err(ServiceException::invalid(format!(
            "LAYERS names {} layers; at most {} are drawn in one map",
            drawn.len(),
            app.limits.maximum_layers
        )));
    }
    Ok(drawn)
}

/// The layers that a parameter names, as often as it does.
pub fn layers(app: &AppState, parameters: &Parameters, name: &str) -> Result<Vec<Layer>, ServiceException> {
    let text = parameters.require(name, "elevation")?;
    text.split(',').map(|one| layer(app, one, name)).collect()
}

/// The layer of a name.
pub fn layer(app: &AppState, text: &str, parameter: &str) -> Result<Layer, ServiceException> {
    Layer::from_name(text).filter(|&layer| has_layer(&app.scene, layer)).ok_or_else(|| {
        let names = layer_names(&app.scene);
        let near = suggestion(text, names.iter().copied());
        ServiceException::new(
            Some("LayerNotDefined"),
            format!("{parameter} names \"{text}\"; this scene has the layers {}{near}", names.join(", ")),
        )
    })
}

/// Whether a style is the filled photo.
pub fn filled(style: &str, layer: Layer) -> Result<bool, ServiceException> {
    match style {
        "" | DEFAULT_STYLE => Ok(false),
        FILLED_STYLE if layer == Layer::Texture => Ok(true),
        style => Err(ServiceException::new(
            Some("StyleNotDefined"),
            format!(
                "the style \"{style}\" is not defined; the layer {} has the style \"default\"{} (or leave it empty: STYLES=)",
                layer.name(),
                if layer == Layer::Texture { " and \"filled\"" } else { "" }
            ),
        )),
    }
}
