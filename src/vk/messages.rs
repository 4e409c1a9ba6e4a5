//! The messages of the validation layer: a messenger collects its errors and warnings in a list.
//!
//! The list is shared, so it can be read after the device and even the instance are gone. Only then are leaked objects
//! reported.

use std::ffi::{CStr, c_void};
use std::sync::{Arc, Mutex};

use ash::ext::debug_utils;
use ash::vk;

use super::{call_failed, lock};
use crate::error::Result;

/// The errors and warnings of the validation layer, oldest first.
#[derive(Debug, Default)]
pub struct ValidationLog {
    messages: Mutex<Vec<String>>,
}

impl ValidationLog {
    /// A copy of all messages so far.
    #[must_use]
    pub fn messages(&self) -> Vec<String> {
        lock(&self.messages).clone()
    }

    /// Moves all messages so far out of the log.
    #[must_use]
    pub fn take(&self) -> Vec<String> {
        std::mem::take(&mut *lock(&self.messages))
    }

    /// What a messenger needs to write into this log, for as long as the log lives.
    pub(super) fn messenger_info(self: &Arc<Self>) -> vk::DebugUtilsMessengerCreateInfoEXT<'static> {
        vk::DebugUtilsMessengerCreateInfoEXT::default()
            .message_severity(
                vk::DebugUtilsMessageSeverityFlagsEXT::ERROR | vk::DebugUtilsMessageSeverityFlagsEXT::WARNING,
            )
            // Other types include the loader's remarks about drivers that do not load, which are not our fault.
            .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION)
            .pfn_user_callback(Some(collect))
            .user_data(Arc::as_ptr(self).cast_mut().cast::<c_void>())
    }
}

/// The messenger; [`super::Instance`] drops it before the instance.
pub(super) struct Messenger {
    functions: debug_utils::Instance,
    handle: vk::DebugUtilsMessengerEXT,
}

impl Messenger {
    pub(super) fn create(entry: &ash::Entry, instance: &ash::Instance, log: &Arc<ValidationLog>) -> Result<Self> {
        let functions = debug_utils::Instance::new(entry, instance);
        // SAFETY: V1; the log that the callback writes to is held by the instance.
        let handle = unsafe { functions.create_debug_utils_messenger(&log.messenger_info(), None) }
            .map_err(|result| call_failed("vkCreateDebugUtilsMessengerEXT", result))?;
        Ok(Self { functions, handle })
    }

    /// Stops collecting messages. The instance must still be alive.
    pub(super) fn destroy(&self) {
        // SAFETY: V1; only the instance's `Drop` calls this, once.
        unsafe { self.functions.destroy_debug_utils_messenger(self.handle, None) };
    }
}

/// The callback. Nothing in it can panic: an unwind must not cross into the layer.
unsafe extern "system" fn collect(
    _severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _types: vk::DebugUtilsMessageTypeFlagsEXT,
    message: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    log: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: V1; `log` is the pointer of `messenger_info`, and Vulkan passes a valid message or none.
    let (log, message) = unsafe { (log.cast::<ValidationLog>().as_ref(), message.as_ref()) };
    if let (Some(log), Some(message)) = (log, message)
        && !message.p_message.is_null()
    {
        // SAFETY: V1; Vulkan promises a terminated string.
        let text = unsafe { CStr::from_ptr(message.p_message) };
        lock(&log.messages).push(text.to_string_lossy().into_owned());
    }
    vk::FALSE
}
