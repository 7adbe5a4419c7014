//! Compute passes: shader text in, bindings and a grid in, errors out.

use wgpu::util::DeviceExt;

use crate::{Gpu, GpuError};

/// A compute entry point made ready to run. Its resources are all in group 0.
#[derive(Clone, Debug)]
pub struct ComputePass {
    pipeline: wgpu::ComputePipeline,
}

impl Gpu {
    /// Makes the entry point `entry_point` of valid WGSL ready; `constants` are values of its overrides.
    ///
    /// # Errors
    /// [`GpuError::Pass`] where the device refuses it.
    pub fn compute_pass(
        &self,
        wgsl: &str,
        entry_point: &str,
        constants: &[(&str, f64)],
    ) -> Result<ComputePass, GpuError> {
        let (pipeline, error) = self.catch_errors(|| {
            let module = self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(entry_point),
                source: wgpu::ShaderSource::Wgsl(wgsl.into()),
            });
            self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry_point),
                layout: None,
                module: &module,
                entry_point: Some(entry_point),
                compilation_options: wgpu::PipelineCompilationOptions { constants, ..Default::default() },
                cache: None,
            })
        });
        error.map_or(Ok(ComputePass { pipeline }), |reason| Err(GpuError::Pass { reason }))
    }

    /// Queues a pass over a grid of workgroups. Results are there once they are read back, or after [`Gpu::wait`].
    ///
    /// # Errors
    /// [`GpuError::Pass`] where the bindings do not fit the shader.
    pub fn run_pass(
        &self,
        pass: &ComputePass,
        bindings: &[wgpu::BindGroupEntry<'_>],
        workgroups: [u32; 3],
    ) -> Result<(), GpuError> {
        let (_, error) = self.catch_errors(|| {
            let group = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: None,
                layout: &pass.pipeline.get_bind_group_layout(0),
                entries: bindings,
            });
            let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            {
                let mut commands = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
                commands.set_pipeline(&pass.pipeline);
                commands.set_bind_group(0, &group, &[]);
                let [x, y, z] = workgroups;
                commands.dispatch_workgroups(x, y, z);
            }
            self.queue.submit([encoder.finish()]);
        });
        error.map_or(Ok(()), |reason| Err(GpuError::Pass { reason }))
    }

    /// A buffer that holds `bytes`; [`Gpu::read_buffer`] reads it back if `usage` has `COPY_SRC`.
    pub fn buffer(&self, bytes: &[u8], usage: wgpu::BufferUsages) -> wgpu::Buffer {
        self.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: None,
            contents: bytes,
            usage,
        })
    }
}
