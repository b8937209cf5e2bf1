//! Materials that have no counterpart: the nearest model stands in, and is reported.

use super::Importer;
use super::material::{Alpha, Model, Roughness, rough};
use super::params::Params;
use super::texture::Texture;
use super::xml::Node;
use crate::load::LoadError;
use crate::spectrum::Spectrum;

/// Refractive index of coatings where nothing is said.
const COATING: f64 = 1.5;

impl Importer<'_> {
    /// The model for a material of several layers or with effects that Mitsuba does not have.
    pub(super) fn layered(&mut self, kind: &str, params: &mut Params) -> Result<Model, LoadError> {
        let four = Roughness::SquareRoot;
        match kind {
            "coateddiffuse" => {
                self.report.approximated(
                    &params.spot,
                    "coateddiffuse: a plastic, with light between its layers in closed form",
                );
                params.ignore(&["thickness", "maxdepth", "nsamples"]);
                self.plastic(params, ["reflectance", ""], [0.5, 1.0], 0.0, four)
            }
            "plastic" => self.plastic(params, ["Kd", "Ks"], [0.25, 0.25], 0.1, Roughness::Polynomial),
            "substrate" => {
                self.report.approximated(&params.spot, "substrate: a plastic");
                self.plastic(params, ["Kd", "Ks"], [0.5, 0.5], 0.1, Roughness::Polynomial)
            }
            "uber" => self.uber(params),
            "coatedconductor" => {
                self.report.approximated(&params.spot, "coatedconductor: the conductor without its coating");
                params.list.retain(|param| !param.name.starts_with("interface."));
                params.ignore(&["thickness", "maxdepth", "nsamples"]);
                self.conductor(params, "conductor.", 0.0, four)
            }
            "translucent" => self.replaced(kind, params, "Kd", 0.25, "diffuse, opaque"),
            "diffusetransmission" => self.replaced(kind, params, "reflectance", 0.25, "diffuse, opaque"),
            "hair" => {
                params.any("sigma_a");
                self.replaced(kind, params, "color", 0.2, "diffuse")
            }
            "disney" => {
                self.report.approximated(&params.spot, "disney: a plastic");
                let model = self.plastic(params, ["color", ""], [0.5, 1.0], 0.5, four);
                params.list.clear();
                model
            }
            "subsurface" | "kdsubsurface" => {
                self.report.approximated(&params.spot, format!("{kind}: a plastic, light does not enter"));
                let colour = if params.has("Kd") { "Kd" } else { "reflectance" };
                let model = self.plastic(params, [colour, ""], [0.5, 1.0], 0.0, four);
                params.list.retain(|param| ["displacement", "normalmap", "bumpmap"].contains(&param.name.as_str()));
                model
            }
            _ => self.replaced(kind, params, "reflectance", 0.5, "grey and diffuse"),
        }
    }

    fn replaced(
        &mut self,
        kind: &str,
        params: &mut Params,
        colour: &str,
        default: f64,
        by: &str,
    ) -> Result<Model, LoadError> {
        self.report.approximated(&params.spot, format!("{kind}: {by}"));
        let reflectance = self.share(params, colour, default)?;
        params.list.retain(|param| ["displacement", "normalmap", "bumpmap"].contains(&param.name.as_str()));
        Ok(Model::opaque(Node::new("bsdf", "diffuse").child(reflectance.node("reflectance"))))
    }

    /// A diffuse base under a dielectric coating. `names` are those of its diffuse and specular colours.
    fn plastic(
        &mut self,
        params: &mut Params,
        names: [&str; 2],
        defaults: [f64; 2],
        roughness: f64,
        law: Roughness,
    ) -> Result<Model, LoadError> {
        let alpha = self.one_alpha(params, roughness, law)?;
        let eta = self.index(params, &["eta", "index"], COATING)?;
        let diffuse = self.share(params, names[0], defaults[0])?;
        let specular = self.share(params, names[1], defaults[1])?;
        let node = rough("plastic", "roughplastic", alpha).float("int_ior", eta).float("ext_ior", 1.0);
        let node = node.boolean("nonlinear", true).child(diffuse.node("diffuse_reflectance"));
        let white = specular.constant() == Some(Spectrum::ONE);
        Ok(Model::opaque(if white { node } else { node.child(specular.node("specular_reflectance")) }))
    }

    /// Mitsuba's coatings are as rough along u as along v.
    fn one_alpha(&mut self, params: &mut Params, roughness: f64, law: Roughness) -> Result<Alpha, LoadError> {
        let [u, v] = self.alpha(params, "", roughness, law)?;
        if u != v {
            self.report.approximated(&params.spot, "a coating that is rougher along one axis: the mean of both");
        }
        Ok([(u * v).sqrt(); 2])
    }

    /// A plastic that may let light through as a whole.
    fn uber(&mut self, params: &mut Params) -> Result<Model, LoadError> {
        for name in ["Kr", "Kt"] {
            if self.maybe_texture(params, name)?.is_some_and(|t| t.constant().is_none_or(|colour| !colour.is_black())) {
                self.report.left_out(&params.spot, format!("`{name}` of uber"));
            }
        }
        let opacity = self.maybe_share(params, "opacity")?;
        let opaque = opacity.as_ref().and_then(Texture::constant) == Some(Spectrum::ONE);
        let model = self.plastic(params, ["Kd", "Ks"], [0.25, 0.25], 0.1, Roughness::Polynomial)?;
        Ok(Model { opacity: opacity.filter(|_| !opaque), ..model })
    }
}
