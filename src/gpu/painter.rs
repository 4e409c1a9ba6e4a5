//! The painter of a Vulkan device: opaque tiles by the graphics pass, translucent ones by the compute pass that
//! composites. Where the device has no graphics, the twin draws the opaque ones.

use std::sync::Arc;

use super::compose::ComposePass;
use super::mosaic::MosaicPass;
use crate::cpu::CpuPainter;
use crate::error::Result;
use crate::model::{Blend, Canvas, Mosaic, Painter, Population};
use crate::vk::{Device, Recorder, Timing};

/// Draws on a Vulkan device. It holds no memory of the device between two drawings.
pub struct GpuPainter {
    device: Arc<Device>,
    recorder: Recorder,
}

impl GpuPainter {
    /// A painter of this device.
    ///
    /// # Errors
    /// If the device fails.
    pub fn create(device: &Arc<Device>) -> Result<Self> {
        Ok(Self { device: Arc::clone(device), recorder: Recorder::create(device, "painter", Timing::Off)? })
    }

    /// The fly that shows at each pixel as the graphics pass draws it, or [`crate::model::NO_FLY`].
    ///
    /// # Errors
    /// If the device fails, or has no graphics.
    pub fn draw_fly_layer(&mut self, population: &Population) -> Result<Vec<u32>> {
        let canvas = Canvas::evaluation(population.width_px, population.height_px);
        MosaicPass::create(&self.device, &mut self.recorder, population, &canvas)?.draw_fly_layer(&mut self.recorder)
    }
}

impl Painter for GpuPainter {
    fn draw_watched(
        &mut self,
        population: &Population,
        canvas: &Canvas,
        supersampling: u32,
        watch: &mut dyn FnMut(f64),
    ) -> Result<Mosaic> {
        if population.masks.blend() == Blend::Translucent {
            let pass = ComposePass::create(&self.device, &mut self.recorder, population, canvas, supersampling)?;
            return pass.draw(&mut self.recorder, canvas, supersampling, watch);
        }
        if !self.device.info().can_draw() {
            return CpuPainter.draw_watched(population, canvas, supersampling, watch);
        }
        let samples = canvas.supersampled(supersampling);
        let pass = MosaicPass::create(&self.device, &mut self.recorder, population, &samples)?;
        pass.draw(&mut self.recorder, canvas, supersampling, watch)
    }
}
