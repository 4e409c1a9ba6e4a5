/* Compiles modules of spirv/ by a Vulkan driver and prints what it tells of them, for tools/compile-for-amd.
 *
 * null_compile MODULE.spv... makes a compute pipeline of each, as hardware gets it: workgroups of 64, and specialisation
 * constants that leave everything in. One line each: name, statistics by VK_KHR_pipeline_executable_properties. */

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <vulkan/vulkan.h>

/* As many as cells.comp has (vk::NEEDED_LIMITS), and bytes that no module's push constants exceed. */
enum { BUFFERS = 14, PUSH_BYTES = 64 };

static void expect(VkResult result, const char *what) {
    if (result != VK_SUCCESS) {
        fprintf(stderr, "null_compile: %s failed (%d)\n", what, result);
        exit(1);
    }
}

static uint32_t *read_words(const char *path, size_t *bytes) {
    FILE *file = fopen(path, "rb");
    if (!file || fseek(file, 0, SEEK_END) != 0) {
        fprintf(stderr, "null_compile: %s cannot be read\n", path);
        exit(1);
    }
    *bytes = (size_t)ftell(file);
    rewind(file);
    uint32_t *words = malloc(*bytes);
    if (!words || fread(words, 1, *bytes, file) != *bytes) {
        fprintf(stderr, "null_compile: %s cannot be read\n", path);
        exit(1);
    }
    fclose(file);
    return words;
}

int main(int count, char **paths) {
    VkApplicationInfo application = {.sType = VK_STRUCTURE_TYPE_APPLICATION_INFO, .apiVersion = VK_API_VERSION_1_3};
    VkInstanceCreateInfo instance_info = {.sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO,
                                          .pApplicationInfo = &application};
    VkInstance instance;
    expect(vkCreateInstance(&instance_info, NULL, &instance), "vkCreateInstance");
    uint32_t devices = 1;
    VkPhysicalDevice physical = VK_NULL_HANDLE;
    vkEnumeratePhysicalDevices(instance, &devices, &physical);
    if (devices == 0) {
        fprintf(stderr, "null_compile: the driver offers no device\n");
        return 1;
    }
    float priority = 1;
    VkDeviceQueueCreateInfo queue = {.sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO,
                                     .queueCount = 1,
                                     .pQueuePriorities = &priority};
    VkPhysicalDevicePipelineExecutablePropertiesFeaturesKHR tells = {
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PIPELINE_EXECUTABLE_PROPERTIES_FEATURES_KHR,
        .pipelineExecutableInfo = VK_TRUE};
    VkPhysicalDeviceVulkan13Features features = {.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_FEATURES,
                                                 .pNext = &tells,
                                                 .synchronization2 = VK_TRUE,
                                                 .maintenance4 = VK_TRUE};
    const char *extension = VK_KHR_PIPELINE_EXECUTABLE_PROPERTIES_EXTENSION_NAME;
    VkDeviceCreateInfo device_info = {.sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO,
                                      .pNext = &features,
                                      .queueCreateInfoCount = 1,
                                      .pQueueCreateInfos = &queue,
                                      .enabledExtensionCount = 1,
                                      .ppEnabledExtensionNames = &extension};
    VkDevice device;
    expect(vkCreateDevice(physical, &device_info, NULL, &device), "vkCreateDevice");
    PFN_vkGetPipelineExecutableStatisticsKHR statistics =
        (PFN_vkGetPipelineExecutableStatisticsKHR)vkGetDeviceProcAddr(device, "vkGetPipelineExecutableStatisticsKHR");

    VkDescriptorSetLayoutBinding bindings[BUFFERS];
    for (uint32_t place = 0; place < BUFFERS; ++place)
        bindings[place] = (VkDescriptorSetLayoutBinding){.binding = place,
                                                         .descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER,
                                                         .descriptorCount = 1,
                                                         .stageFlags = VK_SHADER_STAGE_COMPUTE_BIT};
    VkDescriptorSetLayoutCreateInfo set_info = {.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO,
                                                .bindingCount = BUFFERS,
                                                .pBindings = bindings};
    VkDescriptorSetLayout set;
    expect(vkCreateDescriptorSetLayout(device, &set_info, NULL, &set), "vkCreateDescriptorSetLayout");
    VkPushConstantRange push = {.stageFlags = VK_SHADER_STAGE_COMPUTE_BIT, .size = PUSH_BYTES};
    VkPipelineLayoutCreateInfo layout_info = {.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO,
                                              .setLayoutCount = 1,
                                              .pSetLayouts = &set,
                                              .pushConstantRangeCount = 1,
                                              .pPushConstantRanges = &push};
    VkPipelineLayout layout;
    expect(vkCreatePipelineLayout(device, &layout_info, NULL, &layout), "vkCreatePipelineLayout");

    for (int number = 1; number < count; ++number) {
        size_t bytes;
        uint32_t *words = read_words(paths[number], &bytes);
        VkShaderModuleCreateInfo module_info = {.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO,
                                                .codeSize = bytes,
                                                .pCode = words};
        VkShaderModule module;
        expect(vkCreateShaderModule(device, &module_info, NULL, &module), paths[number]);
        /* Invocations of a workgroup; of the cells also that there are several subgroups. What a module has not is
         * passed over. */
        uint32_t values[] = {64, 1, 64};
        VkSpecializationMapEntry entries[] = {{0, 0, 4}, {1, 4, 4}, {11, 8, 4}};
        int is_cells = strstr(paths[number], "cells") != NULL;
        VkSpecializationInfo constants = {is_cells ? 3 : 1, entries, sizeof values, values};
        VkComputePipelineCreateInfo info = {
            .sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO,
            .flags = VK_PIPELINE_CREATE_CAPTURE_STATISTICS_BIT_KHR,
            .stage = {.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO,
                      .stage = VK_SHADER_STAGE_COMPUTE_BIT,
                      .module = module,
                      .pName = "main",
                      .pSpecializationInfo = &constants},
            .layout = layout};
        VkPipeline pipeline;
        expect(vkCreateComputePipelines(device, VK_NULL_HANDLE, 1, &info, NULL, &pipeline), paths[number]);
        VkPipelineExecutableInfoKHR executable = {.sType = VK_STRUCTURE_TYPE_PIPELINE_EXECUTABLE_INFO_KHR,
                                                  .pipeline = pipeline};
        VkPipelineExecutableStatisticKHR found[64];
        for (int place = 0; place < 64; ++place)
            found[place] = (VkPipelineExecutableStatisticKHR){.sType =
                                                                  VK_STRUCTURE_TYPE_PIPELINE_EXECUTABLE_STATISTIC_KHR};
        uint32_t found_count = 64;
        expect(statistics(device, &executable, &found_count, found), "vkGetPipelineExecutableStatisticsKHR");
        const char *name = strrchr(paths[number], '/');
        printf("%s", name ? name + 1 : paths[number]);
        for (uint32_t place = 0; place < found_count; ++place)
            if (found[place].format == VK_PIPELINE_EXECUTABLE_STATISTIC_FORMAT_UINT64_KHR)
                printf("\t%s=%llu", found[place].name, (unsigned long long)found[place].value.u64);
        putchar('\n');
        free(words);
    }
    return 0;
}
