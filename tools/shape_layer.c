/* A Vulkan layer that makes a device look and behave otherwise than it is, so that tests on software Vulkan run what
 * other hardware would run. tools/shaped builds it and runs a program with it.
 *
 * SMALTI_SHAPE holds words and numbers with commas between them:
 *
 *   discrete, integrated    the kind of device that is reported
 *   staging                 two types of memory in two heaps: 0 is only on the device, 1 is mapped and not cached
 *   heap=BYTES              the size of every heap; memory beyond it runs out, counted for each VkDevice alone
 *   allocation=BYTES        maxMemoryAllocationSize; larger memory runs out
 *   buffer=BYTES            maxBufferSize
 *   storage-range=BYTES     maxStorageBufferRange
 *   storage-buffers=COUNT   maxPerStageDescriptorStorageBuffers
 *   push=BYTES              maxPushConstantsSize
 *   workgroups=COUNT        maxComputeWorkGroupCount, along each side
 *   invocations=COUNT       maxComputeWorkGroupInvocations, and maxComputeWorkGroupSize at most that
 *   shared=BYTES            maxComputeSharedMemorySize
 *   no-arithmetic           subgroups have only their basic operations
 *   no-subgroups            subgroups have no operations
 *   compute-only            no queue draws
 *   no-feature=NAME         without dynamicRendering, synchronization2, maintenance4 or shaderDemoteToHelperInvocation;
 *                           may come several times
 *   lose=N                  the N-th submission to a device, counted from 1, finds the device lost
 *   hang=N                  the N-th submission to a device and all later ones never end
 *   slow=MS                 each submission takes that many milliseconds or longer
 *
 * A program that goes beyond what it was told is aborted with a line on stderr, as hardware may do anything then: else
 * software Vulkan, which can do more, would hide the fault. Only `invocations` and `shared` are merely reported: the
 * validation layer compares them with the shaders (tools/shaped --validated). A word that is not known aborts too: a
 * test must not pass because nothing was tested. */

#include <errno.h>
#include <inttypes.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <vulkan/vk_layer.h>
#include <vulkan/vulkan.h>

#define EXPORT __attribute__((visibility("default")))
#define COUNT_OF(array) (sizeof(array) / sizeof((array)[0]))
#define NEVER UINT64_MAX
#define NS_PER_MS UINT64_C(1000000)
#define NS_PER_S UINT64_C(1000000000)
/* The longest sleep, so that a wait notices soon what another thread did. */
#define SLICE_NS (10 * NS_PER_MS)

__attribute__((format(printf, 1, 2))) static void say(const char *format, ...) {
    char line[512];
    va_list values;
    va_start(values, format);
    vsnprintf(line, sizeof line, format, values);
    va_end(values);
    /* One call, so that lines of several threads do not mix. */
    fprintf(stderr, "VK_LAYER_SMALTI_shape: %s\n", line);
}

#define REFUSE(...) (say(__VA_ARGS__), abort())

static void *allocate_or_abort(size_t bytes) {
    void *memory = calloc(1, bytes ? bytes : 1);
    if (!memory)
        REFUSE("no memory for the layer itself");
    return memory;
}

/* ---- The shape ---- */

enum feature { DYNAMIC_RENDERING, SYNCHRONIZATION2, MAINTENANCE4, SHADER_DEMOTE, FEATURE_COUNT };
static const char *const feature_names[FEATURE_COUNT] = {"dynamicRendering", "synchronization2", "maintenance4",
                                                         "shaderDemoteToHelperInvocation"};

/* A number is 0 where none was given. */
static struct {
    bool is_discrete, is_integrated, is_staging, is_compute_only, no_arithmetic, no_subgroups;
    bool hides[FEATURE_COUNT];
    uint64_t heap, allocation, buffer, storage_range, storage_buffers, push, workgroups, invocations, shared;
    uint64_t lose, hang, slow;
} shape;

static const struct {
    const char *name;
    bool *flag;
} shape_words[] = {
    {"discrete", &shape.is_discrete},         {"integrated", &shape.is_integrated},
    {"staging", &shape.is_staging},           {"compute-only", &shape.is_compute_only},
    {"no-arithmetic", &shape.no_arithmetic},  {"no-subgroups", &shape.no_subgroups},
};

static const struct {
    const char *name;
    uint64_t *number;
    uint64_t largest;
} shape_numbers[] = {
    {"heap", &shape.heap, UINT64_MAX},
    {"allocation", &shape.allocation, UINT64_MAX},
    {"buffer", &shape.buffer, UINT64_MAX},
    {"storage-range", &shape.storage_range, UINT32_MAX},
    {"storage-buffers", &shape.storage_buffers, UINT32_MAX},
    {"push", &shape.push, UINT32_MAX},
    {"workgroups", &shape.workgroups, UINT32_MAX},
    {"invocations", &shape.invocations, UINT32_MAX},
    {"shared", &shape.shared, UINT32_MAX},
    {"lose", &shape.lose, UINT32_MAX},
    {"hang", &shape.hang, UINT32_MAX},
    {"slow", &shape.slow, UINT32_MAX},
};

static uint64_t read_number(const char *name, const char *text, uint64_t largest) {
    /* strtoull also takes spaces, signs and nothing at all. */
    for (const char *digit = text; *digit; digit++)
        if (*digit < '0' || *digit > '9')
            REFUSE("SMALTI_SHAPE: %s=%s is not a number", name, text);
    errno = 0;
    unsigned long long number = strtoull(text, NULL, 10);
    if (errno || number < 1 || number > largest)
        REFUSE("SMALTI_SHAPE: %s=%s is not from 1 to %" PRIu64, name, text, largest);
    return number;
}

static void read_word(char *word) {
    char *value = strchr(word, '=');
    if (!value) {
        for (size_t i = 0; i < COUNT_OF(shape_words); i++) {
            if (!strcmp(word, shape_words[i].name)) {
                if (*shape_words[i].flag)
                    REFUSE("SMALTI_SHAPE: %s comes twice", word);
                *shape_words[i].flag = true;
                return;
            }
        }
        REFUSE("SMALTI_SHAPE: the word '%s' is not known", word);
    }
    *value++ = '\0';
    if (!strcmp(word, "no-feature")) {
        for (int i = 0; i < FEATURE_COUNT; i++) {
            if (!strcmp(value, feature_names[i])) {
                if (shape.hides[i])
                    REFUSE("SMALTI_SHAPE: no-feature=%s comes twice", value);
                shape.hides[i] = true;
                return;
            }
        }
        REFUSE("SMALTI_SHAPE: the feature '%s' is not known", value);
    }
    for (size_t i = 0; i < COUNT_OF(shape_numbers); i++) {
        if (!strcmp(word, shape_numbers[i].name)) {
            if (*shape_numbers[i].number)
                REFUSE("SMALTI_SHAPE: %s comes twice", word);
            *shape_numbers[i].number = read_number(word, value, shape_numbers[i].largest);
            return;
        }
    }
    REFUSE("SMALTI_SHAPE: the word '%s=' is not known", word);
}

static void read_shape(void) {
    const char *given = getenv("SMALTI_SHAPE");
    if (!given)
        REFUSE("SMALTI_SHAPE is not set");
    char *words = strdup(given), *rest = words, *word;
    /* Not strtok: an empty word, as at a forgotten value, is a mistake as well. */
    while ((word = strsep(&rest, ",")))
        read_word(word);
    free(words);
    if (shape.is_discrete && shape.is_integrated)
        REFUSE("SMALTI_SHAPE: a device is either discrete or integrated");
    if (shape.no_arithmetic && shape.no_subgroups)
        REFUSE("SMALTI_SHAPE: no-subgroups includes no-arithmetic");
}

/* ---- Time ---- */

static uint64_t now_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * NS_PER_S + (uint64_t)now.tv_nsec;
}

static uint64_t smaller(uint64_t a, uint64_t b) { return a < b ? a : b; }

static void sleep_slice(uint64_t ns) {
    ns = smaller(ns, SLICE_NS);
    nanosleep(&(struct timespec){.tv_sec = (time_t)(ns / NS_PER_S), .tv_nsec = (long)(ns % NS_PER_S)}, NULL);
}

/* ---- Instances and devices ---- */

/* Each function whose next one is kept, and what it is called here. One that became part of Vulkan's core is also known
 * by its older name, which ends in KHR. */
#define INSTANCE_FUNCTIONS(X)                                                                                          \
    X(DestroyInstance, destroy_instance)                                                                               \
    X(CreateDevice, create_device)                                                                                     \
    X(GetPhysicalDeviceProperties, properties)                                                                         \
    X(GetPhysicalDeviceProperties2, properties2)                                                                       \
    X(GetPhysicalDeviceFeatures2, features2)                                                                           \
    X(GetPhysicalDeviceMemoryProperties, memory_properties)                                                            \
    X(GetPhysicalDeviceMemoryProperties2, memory_properties2)                                                          \
    X(GetPhysicalDeviceQueueFamilyProperties, queue_families)                                                          \
    X(GetPhysicalDeviceQueueFamilyProperties2, queue_families2)

#define DEVICE_FUNCTIONS(X)                                                                                            \
    X(DestroyDevice, destroy_device)                                                                                   \
    X(DeviceWaitIdle, device_wait_idle)                                                                                \
    X(AllocateMemory, allocate_memory)                                                                                 \
    X(FreeMemory, free_memory)                                                                                         \
    X(MapMemory, map_memory)                                                                                           \
    X(GetBufferMemoryRequirements, buffer_requirements)                                                                \
    X(GetBufferMemoryRequirements2, buffer_requirements2)                                                              \
    X(GetImageMemoryRequirements, image_requirements)                                                                  \
    X(GetImageMemoryRequirements2, image_requirements2)                                                                \
    X(GetDeviceBufferMemoryRequirements, device_buffer_requirements)                                                   \
    X(GetDeviceImageMemoryRequirements, device_image_requirements)                                                     \
    X(CreateBuffer, create_buffer)                                                                                     \
    X(DestroyBuffer, destroy_buffer)                                                                                   \
    X(CreateShaderModule, create_shader_module)                                                                        \
    X(CreateGraphicsPipelines, create_graphics_pipelines)                                                              \
    X(CreateDescriptorSetLayout, create_descriptor_set_layout)                                                         \
    X(DestroyDescriptorSetLayout, destroy_descriptor_set_layout)                                                       \
    X(CreatePipelineLayout, create_pipeline_layout)                                                                    \
    X(UpdateDescriptorSets, update_descriptor_sets)                                                                    \
    X(UpdateDescriptorSetWithTemplate, update_descriptor_set_with_template)                                            \
    X(CmdPushDescriptorSetKHR, push_descriptor_set)                                                                    \
    X(CmdPushDescriptorSetWithTemplateKHR, push_descriptor_set_with_template)                                          \
    X(CmdDispatch, cmd_dispatch)                                                                                       \
    X(CmdDispatchBase, cmd_dispatch_base)                                                                              \
    X(CmdDispatchIndirect, cmd_dispatch_indirect)                                                                      \
    X(CmdBeginRendering, cmd_begin_rendering)                                                                          \
    X(CmdBeginRenderPass, cmd_begin_render_pass)                                                                       \
    X(CmdBeginRenderPass2, cmd_begin_render_pass2)                                                                     \
    X(CmdPipelineBarrier2, cmd_pipeline_barrier2)                                                                      \
    X(CmdWriteTimestamp2, cmd_write_timestamp2)                                                                        \
    X(QueueSubmit, queue_submit)                                                                                       \
    X(QueueSubmit2, queue_submit2)                                                                                     \
    X(QueueBindSparse, queue_bind_sparse)                                                                              \
    X(QueueWaitIdle, queue_wait_idle)                                                                                  \
    X(WaitForFences, wait_for_fences)                                                                                  \
    X(ResetFences, reset_fences)                                                                                       \
    X(DestroyFence, destroy_fence)                                                                                     \
    X(GetFenceStatus, fence_status)                                                                                    \
    X(GetEventStatus, event_status)                                                                                    \
    X(GetQueryPoolResults, query_pool_results)                                                                         \
    X(WaitSemaphores, wait_semaphores)                                                                                 \
    X(GetSemaphoreCounterValue, semaphore_counter_value)

#define FIELD(name, here) PFN_vk##name here;

typedef struct instance {
    struct instance *next_instance;
    void *key;
    VkInstance handle;
    PFN_vkGetInstanceProcAddr instance_function;
    struct {
        INSTANCE_FUNCTIONS(FIELD)
    } next;
} instance_t;

enum object_kind { BUFFER, MEMORY, FENCE, SET_LAYOUT };
#define STAGE_COUNT 6
#define BUCKET_COUNT 256

/* What is known of a Vulkan object of a device. */
typedef struct object {
    struct object *next_object;
    enum object_kind kind;
    uint64_t handle;
    /* Of buffers and memory, in bytes. */
    uint64_t size;
    /* Of memory. */
    uint32_t heap;
    bool device_only;
    /* Of a fence: until then it is held back. */
    uint64_t ready_at;
    /* Of a descriptor set's layout, for each stage from the vertex shader to the compute shader. */
    uint64_t storage_buffers[STAGE_COUNT];
} object_t;

typedef struct device {
    struct device *next_device;
    void *key;
    PFN_vkGetDeviceProcAddr device_function;
    struct {
        DEVICE_FUNCTIONS(FIELD)
    } next;
    /* The driver's types of memory. */
    VkPhysicalDeviceMemoryProperties memory;
    /* Guards all that follows. */
    pthread_mutex_t lock;
    object_t *objects[BUCKET_COUNT];
    uint64_t heap_used[VK_MAX_MEMORY_HEAPS];
    uint64_t submissions;
    uint64_t busy_until;
    bool is_lost, is_hung;
} device_t;

static pthread_mutex_t registry_lock = PTHREAD_MUTEX_INITIALIZER;
static instance_t *instances;
static device_t *devices;

/* Instances, devices and what belongs to either begin with a pointer of the loader's, which tells whose they are. */
static void *key_of(const void *handle) { return *(void *const *)handle; }

static instance_t *instance_of(const void *handle) {
    pthread_mutex_lock(&registry_lock);
    instance_t *instance = instances;
    while (instance && instance->key != key_of(handle))
        instance = instance->next_instance;
    pthread_mutex_unlock(&registry_lock);
    if (!instance)
        REFUSE("a call names an instance that was not made through this layer");
    return instance;
}

static device_t *device_of(const void *handle) {
    pthread_mutex_lock(&registry_lock);
    device_t *device = devices;
    while (device && device->key != key_of(handle))
        device = device->next_device;
    pthread_mutex_unlock(&registry_lock);
    if (!device)
        REFUSE("a call names a device that was not made through this layer");
    return device;
}

/* Where the pointer to an object is or would be. The device is locked. */
static object_t **object_place(device_t *device, enum object_kind kind, uint64_t handle) {
    /* Handles are often addresses: their lowest bits are equal. */
    object_t **place = &device->objects[(handle ^ handle >> 4 ^ handle >> 12) % BUCKET_COUNT];
    while (*place && ((*place)->kind != kind || (*place)->handle != handle))
        place = &(*place)->next_object;
    return place;
}

/* A new object, or the old one with that handle. The device is locked. */
static object_t *object_put(device_t *device, enum object_kind kind, uint64_t handle) {
    object_t **place = object_place(device, kind, handle);
    if (!*place) {
        *place = allocate_or_abort(sizeof **place);
        (*place)->kind = kind;
        (*place)->handle = handle;
    }
    return *place;
}

/* The device is locked. */
static void object_remove(device_t *device, enum object_kind kind, uint64_t handle) {
    object_t **place = object_place(device, kind, handle), *object = *place;
    if (object) {
        *place = object->next_object;
        free(object);
    }
}

/* Before the driver destroys it, since another thread's new object may get the same handle at once. */
static void forget(device_t *device, enum object_kind kind, uint64_t handle) {
    pthread_mutex_lock(&device->lock);
    object_remove(device, kind, handle);
    pthread_mutex_unlock(&device->lock);
}

/* ---- What a physical device reports ---- */

static void limit(uint32_t *field, uint64_t number) {
    if (number)
        *field = (uint32_t)number;
}

static void shape_properties(VkPhysicalDeviceProperties *properties) {
    VkPhysicalDeviceLimits *limits = &properties->limits;
    if (shape.is_discrete)
        properties->deviceType = VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU;
    if (shape.is_integrated)
        properties->deviceType = VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU;
    limit(&limits->maxStorageBufferRange, shape.storage_range);
    limit(&limits->maxPerStageDescriptorStorageBuffers, shape.storage_buffers);
    limit(&limits->maxPushConstantsSize, shape.push);
    limit(&limits->maxComputeWorkGroupInvocations, shape.invocations);
    limit(&limits->maxComputeSharedMemorySize, shape.shared);
    for (int side = 0; side < 3; side++) {
        limit(&limits->maxComputeWorkGroupCount[side], shape.workgroups);
        if (shape.invocations && limits->maxComputeWorkGroupSize[side] > shape.invocations)
            limits->maxComputeWorkGroupSize[side] = (uint32_t)shape.invocations;
    }
}

static void shape_subgroups(VkSubgroupFeatureFlags *operations) {
    if (shape.no_arithmetic)
        *operations &= VK_SUBGROUP_FEATURE_BASIC_BIT;
    if (shape.no_subgroups)
        *operations = 0;
}

static VKAPI_ATTR void VKAPI_CALL properties(VkPhysicalDevice physical, VkPhysicalDeviceProperties *answer) {
    instance_of(physical)->next.properties(physical, answer);
    shape_properties(answer);
}

static VKAPI_ATTR void VKAPI_CALL properties2(VkPhysicalDevice physical, VkPhysicalDeviceProperties2 *answer) {
    instance_of(physical)->next.properties2(physical, answer);
    shape_properties(&answer->properties);
    for (VkBaseOutStructure *part = answer->pNext; part; part = part->pNext) {
        VkDeviceSize *allocation = NULL, *buffer = NULL;
        if (part->sType == VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_PROPERTIES) {
            shape_subgroups(&((VkPhysicalDeviceVulkan11Properties *)part)->subgroupSupportedOperations);
            allocation = &((VkPhysicalDeviceVulkan11Properties *)part)->maxMemoryAllocationSize;
        }
        if (part->sType == VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_PROPERTIES)
            shape_subgroups(&((VkPhysicalDeviceSubgroupProperties *)part)->supportedOperations);
        if (part->sType == VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_MAINTENANCE_3_PROPERTIES)
            allocation = &((VkPhysicalDeviceMaintenance3Properties *)part)->maxMemoryAllocationSize;
        if (part->sType == VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_PROPERTIES)
            buffer = &((VkPhysicalDeviceVulkan13Properties *)part)->maxBufferSize;
        if (part->sType == VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_MAINTENANCE_4_PROPERTIES)
            buffer = &((VkPhysicalDeviceMaintenance4Properties *)part)->maxBufferSize;
        if (allocation && shape.allocation)
            *allocation = shape.allocation;
        if (buffer && shape.buffer)
            *buffer = shape.buffer;
    }
}

/* Where a structure says whether a feature is there; NULL if it says nothing of it. */
static VkBool32 *feature_in(VkBaseOutStructure *part, enum feature feature) {
    if (part->sType == VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_FEATURES) {
        VkPhysicalDeviceVulkan13Features *all = (VkPhysicalDeviceVulkan13Features *)part;
        VkBool32 *places[FEATURE_COUNT] = {&all->dynamicRendering, &all->synchronization2, &all->maintenance4,
                                           &all->shaderDemoteToHelperInvocation};
        return places[feature];
    }
    if (feature == DYNAMIC_RENDERING && part->sType == VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DYNAMIC_RENDERING_FEATURES)
        return &((VkPhysicalDeviceDynamicRenderingFeatures *)part)->dynamicRendering;
    if (feature == SYNCHRONIZATION2 && part->sType == VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SYNCHRONIZATION_2_FEATURES)
        return &((VkPhysicalDeviceSynchronization2Features *)part)->synchronization2;
    if (feature == MAINTENANCE4 && part->sType == VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_MAINTENANCE_4_FEATURES)
        return &((VkPhysicalDeviceMaintenance4Features *)part)->maintenance4;
    if (feature == SHADER_DEMOTE &&
        part->sType == VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_DEMOTE_TO_HELPER_INVOCATION_FEATURES)
        return &((VkPhysicalDeviceShaderDemoteToHelperInvocationFeatures *)part)->shaderDemoteToHelperInvocation;
    return NULL;
}

static VKAPI_ATTR void VKAPI_CALL features2(VkPhysicalDevice physical, VkPhysicalDeviceFeatures2 *answer) {
    instance_of(physical)->next.features2(physical, answer);
    for (VkBaseOutStructure *part = answer->pNext; part; part = part->pNext) {
        for (int feature = 0; feature < FEATURE_COUNT; feature++) {
            VkBool32 *place = feature_in(part, feature);
            if (place && shape.hides[feature])
                *place = VK_FALSE;
        }
    }
}

#define STAGING_TYPES 2
static const VkMemoryPropertyFlags staging_flags[STAGING_TYPES] = {
    VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT,
    VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT,
};

/* The driver's type of memory behind one of those that `staging` reports. */
static uint32_t real_type(const VkPhysicalDeviceMemoryProperties *real, uint32_t type) {
    if (type >= STAGING_TYPES)
        REFUSE("there are only %d types of memory, but type %u was asked for", STAGING_TYPES, type);
    for (uint32_t i = 0; i < real->memoryTypeCount; i++)
        if ((real->memoryTypes[i].propertyFlags & staging_flags[type]) == staging_flags[type])
            return i;
    REFUSE("the driver has no memory that could pass for type %u", type);
}

static void shape_memory(VkPhysicalDeviceMemoryProperties *memory) {
    if (shape.is_staging) {
        VkPhysicalDeviceMemoryProperties real = *memory;
        memset(memory, 0, sizeof *memory);
        memory->memoryTypeCount = memory->memoryHeapCount = STAGING_TYPES;
        for (uint32_t i = 0; i < STAGING_TYPES; i++) {
            memory->memoryTypes[i] = (VkMemoryType){.propertyFlags = staging_flags[i], .heapIndex = i};
            memory->memoryHeaps[i].size = real.memoryHeaps[real.memoryTypes[real_type(&real, i)].heapIndex].size;
        }
        memory->memoryHeaps[0].flags = VK_MEMORY_HEAP_DEVICE_LOCAL_BIT;
    }
    for (uint32_t i = 0; shape.heap && i < memory->memoryHeapCount; i++)
        memory->memoryHeaps[i].size = shape.heap;
}

static VKAPI_ATTR void VKAPI_CALL memory_properties(VkPhysicalDevice physical,
                                                    VkPhysicalDeviceMemoryProperties *answer) {
    instance_of(physical)->next.memory_properties(physical, answer);
    shape_memory(answer);
}

static VKAPI_ATTR void VKAPI_CALL memory_properties2(VkPhysicalDevice physical,
                                                     VkPhysicalDeviceMemoryProperties2 *answer) {
    instance_of(physical)->next.memory_properties2(physical, answer);
    VkPhysicalDeviceMemoryProperties real = answer->memoryProperties;
    shape_memory(&answer->memoryProperties);
    for (VkBaseOutStructure *part = answer->pNext; part; part = part->pNext) {
        if (part->sType != VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_MEMORY_BUDGET_PROPERTIES_EXT)
            continue;
        VkPhysicalDeviceMemoryBudgetPropertiesEXT *budget = (VkPhysicalDeviceMemoryBudgetPropertiesEXT *)part;
        VkPhysicalDeviceMemoryBudgetPropertiesEXT old = *budget;
        for (uint32_t i = 0; i < answer->memoryProperties.memoryHeapCount; i++) {
            uint32_t heap = shape.is_staging ? real.memoryTypes[real_type(&real, i)].heapIndex : i;
            budget->heapBudget[i] = smaller(old.heapBudget[heap], answer->memoryProperties.memoryHeaps[i].size);
            budget->heapUsage[i] = old.heapUsage[heap];
        }
    }
}

static VKAPI_ATTR void VKAPI_CALL queue_families(VkPhysicalDevice physical, uint32_t *count,
                                                 VkQueueFamilyProperties *answer) {
    instance_of(physical)->next.queue_families(physical, count, answer);
    for (uint32_t i = 0; answer && shape.is_compute_only && i < *count; i++)
        answer[i].queueFlags &= ~(VkQueueFlags)VK_QUEUE_GRAPHICS_BIT;
}

static VKAPI_ATTR void VKAPI_CALL queue_families2(VkPhysicalDevice physical, uint32_t *count,
                                                  VkQueueFamilyProperties2 *answer) {
    instance_of(physical)->next.queue_families2(physical, count, answer);
    for (uint32_t i = 0; answer && shape.is_compute_only && i < *count; i++)
        answer[i].queueFamilyProperties.queueFlags &= ~(VkQueueFlags)VK_QUEUE_GRAPHICS_BIT;
}

/* ---- Memory ---- */

static VKAPI_ATTR VkResult VKAPI_CALL allocate_memory(VkDevice handle, const VkMemoryAllocateInfo *info,
                                                      const VkAllocationCallbacks *allocator, VkDeviceMemory *memory) {
    device_t *device = device_of(handle);
    VkDeviceSize size = info->allocationSize;
    if (shape.allocation && size > shape.allocation) {
        say("vkAllocateMemory: %" PRIu64 " bytes are more than %" PRIu64, size, shape.allocation);
        return VK_ERROR_OUT_OF_DEVICE_MEMORY;
    }
    VkMemoryAllocateInfo real = *info;
    if (shape.is_staging)
        real.memoryTypeIndex = real_type(&device->memory, info->memoryTypeIndex);
    uint32_t heap =
        shape.is_staging ? info->memoryTypeIndex : device->memory.memoryTypes[info->memoryTypeIndex].heapIndex;
    pthread_mutex_lock(&device->lock);
    uint64_t used = device->heap_used[heap];
    bool fits = !shape.heap || (used <= shape.heap && size <= shape.heap - used);
    /* At once, since another thread may ask for the same bytes. */
    if (fits)
        device->heap_used[heap] += size;
    pthread_mutex_unlock(&device->lock);
    if (!fits) {
        say("vkAllocateMemory: %" PRIu64 " bytes do not fit: heap %u has %" PRIu64 ", of which %" PRIu64 " are in use",
            size, heap, shape.heap, used);
        return VK_ERROR_OUT_OF_DEVICE_MEMORY;
    }
    VkResult result = device->next.allocate_memory(handle, &real, allocator, memory);
    pthread_mutex_lock(&device->lock);
    if (result == VK_SUCCESS) {
        object_t *object = object_put(device, MEMORY, (uint64_t)*memory);
        object->size = size;
        object->heap = heap;
        object->device_only = shape.is_staging && info->memoryTypeIndex == 0;
    } else {
        device->heap_used[heap] -= size;
    }
    pthread_mutex_unlock(&device->lock);
    return result;
}

static VKAPI_ATTR void VKAPI_CALL free_memory(VkDevice handle, VkDeviceMemory memory,
                                              const VkAllocationCallbacks *allocator) {
    device_t *device = device_of(handle);
    pthread_mutex_lock(&device->lock);
    object_t *object = *object_place(device, MEMORY, (uint64_t)memory);
    if (object)
        device->heap_used[object->heap] -= object->size;
    object_remove(device, MEMORY, (uint64_t)memory);
    pthread_mutex_unlock(&device->lock);
    device->next.free_memory(handle, memory, allocator);
}

static VKAPI_ATTR VkResult VKAPI_CALL map_memory(VkDevice handle, VkDeviceMemory memory, VkDeviceSize offset,
                                                 VkDeviceSize size, VkMemoryMapFlags flags, void **data) {
    device_t *device = device_of(handle);
    pthread_mutex_lock(&device->lock);
    object_t *object = *object_place(device, MEMORY, (uint64_t)memory);
    bool device_only = object && object->device_only;
    pthread_mutex_unlock(&device->lock);
    if (device_only)
        REFUSE("vkMapMemory: memory of type 0 is on the device and cannot be mapped");
    return device->next.map_memory(handle, memory, offset, size, flags, data);
}

/* Says in which of the reported types of memory something can be. */
static void shape_requirements(const device_t *device, VkMemoryRequirements *requirements) {
    if (!shape.is_staging)
        return;
    uint32_t bits = 0;
    for (uint32_t i = 0; i < STAGING_TYPES; i++)
        bits |= (requirements->memoryTypeBits >> real_type(&device->memory, i) & 1) << i;
    if (!bits)
        REFUSE("the driver wants a type of memory that `staging` does not report");
    requirements->memoryTypeBits = bits;
}

static VKAPI_ATTR void VKAPI_CALL buffer_requirements(VkDevice handle, VkBuffer buffer, VkMemoryRequirements *answer) {
    device_t *device = device_of(handle);
    device->next.buffer_requirements(handle, buffer, answer);
    shape_requirements(device, answer);
}

static VKAPI_ATTR void VKAPI_CALL buffer_requirements2(VkDevice handle, const VkBufferMemoryRequirementsInfo2 *info,
                                                       VkMemoryRequirements2 *answer) {
    device_t *device = device_of(handle);
    device->next.buffer_requirements2(handle, info, answer);
    shape_requirements(device, &answer->memoryRequirements);
}

static VKAPI_ATTR void VKAPI_CALL image_requirements(VkDevice handle, VkImage image, VkMemoryRequirements *answer) {
    device_t *device = device_of(handle);
    device->next.image_requirements(handle, image, answer);
    shape_requirements(device, answer);
}

static VKAPI_ATTR void VKAPI_CALL image_requirements2(VkDevice handle, const VkImageMemoryRequirementsInfo2 *info,
                                                      VkMemoryRequirements2 *answer) {
    device_t *device = device_of(handle);
    device->next.image_requirements2(handle, info, answer);
    shape_requirements(device, &answer->memoryRequirements);
}

static void need_feature(enum feature feature, const char *call) {
    if (shape.hides[feature])
        REFUSE("%s: the device has no %s", call, feature_names[feature]);
}

static VKAPI_ATTR void VKAPI_CALL device_buffer_requirements(VkDevice handle,
                                                             const VkDeviceBufferMemoryRequirements *info,
                                                             VkMemoryRequirements2 *answer) {
    device_t *device = device_of(handle);
    need_feature(MAINTENANCE4, "vkGetDeviceBufferMemoryRequirements");
    device->next.device_buffer_requirements(handle, info, answer);
    shape_requirements(device, &answer->memoryRequirements);
}

static VKAPI_ATTR void VKAPI_CALL device_image_requirements(VkDevice handle,
                                                            const VkDeviceImageMemoryRequirements *info,
                                                            VkMemoryRequirements2 *answer) {
    device_t *device = device_of(handle);
    need_feature(MAINTENANCE4, "vkGetDeviceImageMemoryRequirements");
    device->next.device_image_requirements(handle, info, answer);
    shape_requirements(device, &answer->memoryRequirements);
}

/* ---- Buffers and descriptors ---- */

static VKAPI_ATTR VkResult VKAPI_CALL create_buffer(VkDevice handle, const VkBufferCreateInfo *info,
                                                    const VkAllocationCallbacks *allocator, VkBuffer *buffer) {
    device_t *device = device_of(handle);
    if (shape.buffer && info->size > shape.buffer)
        REFUSE("vkCreateBuffer: %" PRIu64 " bytes are more than %" PRIu64, info->size, shape.buffer);
    VkResult result = device->next.create_buffer(handle, info, allocator, buffer);
    if (result == VK_SUCCESS) {
        pthread_mutex_lock(&device->lock);
        object_put(device, BUFFER, (uint64_t)*buffer)->size = info->size;
        pthread_mutex_unlock(&device->lock);
    }
    return result;
}

static VKAPI_ATTR void VKAPI_CALL destroy_buffer(VkDevice handle, VkBuffer buffer,
                                                 const VkAllocationCallbacks *allocator) {
    device_t *device = device_of(handle);
    forget(device, BUFFER, (uint64_t)buffer);
    device->next.destroy_buffer(handle, buffer, allocator);
}

static bool is_storage_buffer(VkDescriptorType type) {
    return type == VK_DESCRIPTOR_TYPE_STORAGE_BUFFER || type == VK_DESCRIPTOR_TYPE_STORAGE_BUFFER_DYNAMIC;
}

static void check_writes(device_t *device, const char *call, uint32_t count, const VkWriteDescriptorSet *writes) {
    for (uint32_t i = 0; shape.storage_range && i < count; i++) {
        for (uint32_t j = 0; is_storage_buffer(writes[i].descriptorType) && j < writes[i].descriptorCount; j++) {
            const VkDescriptorBufferInfo *info = &writes[i].pBufferInfo[j];
            VkDeviceSize range = info->range;
            if (range == VK_WHOLE_SIZE && info->buffer) {
                pthread_mutex_lock(&device->lock);
                object_t *object = *object_place(device, BUFFER, (uint64_t)info->buffer);
                range = object ? object->size - info->offset : NEVER;
                pthread_mutex_unlock(&device->lock);
            }
            if (info->buffer && range > shape.storage_range)
                REFUSE("%s: binding %u shows shaders %" PRIu64 " bytes of a storage buffer, more than %" PRIu64, call,
                       writes[i].dstBinding, range, shape.storage_range);
        }
    }
}

static VKAPI_ATTR void VKAPI_CALL update_descriptor_sets(VkDevice handle, uint32_t write_count,
                                                         const VkWriteDescriptorSet *writes, uint32_t copy_count,
                                                         const VkCopyDescriptorSet *copies) {
    device_t *device = device_of(handle);
    check_writes(device, "vkUpdateDescriptorSets", write_count, writes);
    device->next.update_descriptor_sets(handle, write_count, writes, copy_count, copies);
}

static VKAPI_ATTR void VKAPI_CALL push_descriptor_set(VkCommandBuffer commands, VkPipelineBindPoint point,
                                                      VkPipelineLayout layout, uint32_t set, uint32_t count,
                                                      const VkWriteDescriptorSet *writes) {
    device_t *device = device_of(commands);
    check_writes(device, "vkCmdPushDescriptorSetKHR", count, writes);
    device->next.push_descriptor_set(commands, point, layout, set, count, writes);
}

static VKAPI_ATTR void VKAPI_CALL update_descriptor_set_with_template(VkDevice handle, VkDescriptorSet set,
                                                                      VkDescriptorUpdateTemplate template,
                                                                      const void *data) {
    if (shape.storage_range)
        REFUSE("storage-range cannot look into vkUpdateDescriptorSetWithTemplate");
    device_of(handle)->next.update_descriptor_set_with_template(handle, set, template, data);
}

static VKAPI_ATTR void VKAPI_CALL push_descriptor_set_with_template(VkCommandBuffer commands,
                                                                    VkDescriptorUpdateTemplate template,
                                                                    VkPipelineLayout layout, uint32_t set,
                                                                    const void *data) {
    if (shape.storage_range)
        REFUSE("storage-range cannot look into vkCmdPushDescriptorSetWithTemplateKHR");
    device_of(commands)->next.push_descriptor_set_with_template(commands, template, layout, set, data);
}

static VKAPI_ATTR VkResult VKAPI_CALL create_descriptor_set_layout(VkDevice handle,
                                                                   const VkDescriptorSetLayoutCreateInfo *info,
                                                                   const VkAllocationCallbacks *allocator,
                                                                   VkDescriptorSetLayout *layout) {
    device_t *device = device_of(handle);
    VkResult result = device->next.create_descriptor_set_layout(handle, info, allocator, layout);
    if (result != VK_SUCCESS)
        return result;
    pthread_mutex_lock(&device->lock);
    object_t *object = object_put(device, SET_LAYOUT, (uint64_t)*layout);
    memset(object->storage_buffers, 0, sizeof object->storage_buffers);
    for (uint32_t i = 0; i < info->bindingCount; i++)
        for (int stage = 0; is_storage_buffer(info->pBindings[i].descriptorType) && stage < STAGE_COUNT; stage++)
            if (info->pBindings[i].stageFlags >> stage & 1)
                object->storage_buffers[stage] += info->pBindings[i].descriptorCount;
    pthread_mutex_unlock(&device->lock);
    return result;
}

static VKAPI_ATTR void VKAPI_CALL destroy_descriptor_set_layout(VkDevice handle, VkDescriptorSetLayout layout,
                                                                const VkAllocationCallbacks *allocator) {
    device_t *device = device_of(handle);
    forget(device, SET_LAYOUT, (uint64_t)layout);
    device->next.destroy_descriptor_set_layout(handle, layout, allocator);
}

static VKAPI_ATTR VkResult VKAPI_CALL create_pipeline_layout(VkDevice handle, const VkPipelineLayoutCreateInfo *info,
                                                             const VkAllocationCallbacks *allocator,
                                                             VkPipelineLayout *layout) {
    device_t *device = device_of(handle);
    uint64_t counts[STAGE_COUNT] = {0};
    pthread_mutex_lock(&device->lock);
    for (uint32_t i = 0; i < info->setLayoutCount; i++) {
        object_t *object = *object_place(device, SET_LAYOUT, (uint64_t)info->pSetLayouts[i]);
        for (int stage = 0; object && stage < STAGE_COUNT; stage++)
            counts[stage] += object->storage_buffers[stage];
    }
    pthread_mutex_unlock(&device->lock);
    for (int stage = 0; shape.storage_buffers && stage < STAGE_COUNT; stage++)
        if (counts[stage] > shape.storage_buffers)
            REFUSE("vkCreatePipelineLayout: %" PRIu64 " storage buffers in one stage are more than %" PRIu64,
                   counts[stage], shape.storage_buffers);
    for (uint32_t i = 0; shape.push && i < info->pushConstantRangeCount; i++) {
        uint64_t end = (uint64_t)info->pPushConstantRanges[i].offset + info->pPushConstantRanges[i].size;
        if (end > shape.push)
            REFUSE("vkCreatePipelineLayout: %" PRIu64 " bytes of push constants are more than %" PRIu64, end,
                   shape.push);
    }
    return device->next.create_pipeline_layout(handle, info, allocator, layout);
}

/* ---- Shaders, drawing and dispatches ---- */

/* The numbers are those of the SPIR-V specification; the headers of Vulkan do not have them. */
#define SPIRV_HEADER_WORDS 5
#define SPIRV_OP_CAPABILITY 17
#define SPIRV_GROUP_NON_UNIFORM 61
#define SPIRV_GROUP_NON_UNIFORM_QUAD 68
#define SPIRV_SUBGROUP_BALLOT 4423
#define SPIRV_SUBGROUP_VOTE 4431
#define SPIRV_DEMOTE_TO_HELPER_INVOCATION 5379

static void check_capability(uint32_t capability) {
    bool is_basic = capability == SPIRV_GROUP_NON_UNIFORM;
    bool is_more = (capability > SPIRV_GROUP_NON_UNIFORM && capability <= SPIRV_GROUP_NON_UNIFORM_QUAD) ||
                   capability == SPIRV_SUBGROUP_BALLOT || capability == SPIRV_SUBGROUP_VOTE;
    if ((is_basic && shape.no_subgroups) || (is_more && (shape.no_subgroups || shape.no_arithmetic)))
        REFUSE("vkCreateShaderModule: the device lacks the subgroup operations of SPIR-V capability %u", capability);
    if (capability == SPIRV_DEMOTE_TO_HELPER_INVOCATION)
        need_feature(SHADER_DEMOTE, "vkCreateShaderModule");
}

static VKAPI_ATTR VkResult VKAPI_CALL create_shader_module(VkDevice handle, const VkShaderModuleCreateInfo *info,
                                                           const VkAllocationCallbacks *allocator,
                                                           VkShaderModule *module) {
    size_t end = info->codeSize / sizeof *info->pCode;
    /* Capabilities come before all else in a module, and each is two words long. */
    for (size_t i = SPIRV_HEADER_WORDS; i + 1 < end && info->pCode[i] == (2 << 16 | SPIRV_OP_CAPABILITY); i += 2)
        check_capability(info->pCode[i + 1]);
    return device_of(handle)->next.create_shader_module(handle, info, allocator, module);
}

static void need_graphics(const char *call) {
    if (shape.is_compute_only)
        REFUSE("%s: the device has no queue for graphics", call);
}

static VKAPI_ATTR VkResult VKAPI_CALL create_graphics_pipelines(VkDevice handle, VkPipelineCache cache, uint32_t count,
                                                                const VkGraphicsPipelineCreateInfo *infos,
                                                                const VkAllocationCallbacks *allocator,
                                                                VkPipeline *pipelines) {
    need_graphics("vkCreateGraphicsPipelines");
    return device_of(handle)->next.create_graphics_pipelines(handle, cache, count, infos, allocator, pipelines);
}

static VKAPI_ATTR void VKAPI_CALL cmd_begin_rendering(VkCommandBuffer commands, const VkRenderingInfo *info) {
    need_graphics("vkCmdBeginRendering");
    need_feature(DYNAMIC_RENDERING, "vkCmdBeginRendering");
    device_of(commands)->next.cmd_begin_rendering(commands, info);
}

static VKAPI_ATTR void VKAPI_CALL cmd_begin_render_pass(VkCommandBuffer commands, const VkRenderPassBeginInfo *info,
                                                        VkSubpassContents contents) {
    need_graphics("vkCmdBeginRenderPass");
    device_of(commands)->next.cmd_begin_render_pass(commands, info, contents);
}

static VKAPI_ATTR void VKAPI_CALL cmd_begin_render_pass2(VkCommandBuffer commands, const VkRenderPassBeginInfo *info,
                                                         const VkSubpassBeginInfo *subpass) {
    need_graphics("vkCmdBeginRenderPass2");
    device_of(commands)->next.cmd_begin_render_pass2(commands, info, subpass);
}

static VKAPI_ATTR void VKAPI_CALL cmd_pipeline_barrier2(VkCommandBuffer commands, const VkDependencyInfo *info) {
    need_feature(SYNCHRONIZATION2, "vkCmdPipelineBarrier2");
    device_of(commands)->next.cmd_pipeline_barrier2(commands, info);
}

static VKAPI_ATTR void VKAPI_CALL cmd_write_timestamp2(VkCommandBuffer commands, VkPipelineStageFlags2 stage,
                                                       VkQueryPool pool, uint32_t query) {
    need_feature(SYNCHRONIZATION2, "vkCmdWriteTimestamp2");
    device_of(commands)->next.cmd_write_timestamp2(commands, stage, pool, query);
}

/* Workgroups are counted from the origin, also where a dispatch begins further on. */
static void check_workgroups(const char *call, const uint64_t ends[3]) {
    for (int side = 0; shape.workgroups && side < 3; side++)
        if (ends[side] > shape.workgroups)
            REFUSE("%s: %" PRIu64 " workgroups along %c are more than %" PRIu64, call, ends[side], "xyz"[side],
                   shape.workgroups);
}

static VKAPI_ATTR void VKAPI_CALL cmd_dispatch(VkCommandBuffer commands, uint32_t x, uint32_t y, uint32_t z) {
    check_workgroups("vkCmdDispatch", (uint64_t[3]){x, y, z});
    device_of(commands)->next.cmd_dispatch(commands, x, y, z);
}

static VKAPI_ATTR void VKAPI_CALL cmd_dispatch_base(VkCommandBuffer commands, uint32_t base_x, uint32_t base_y,
                                                    uint32_t base_z, uint32_t x, uint32_t y, uint32_t z) {
    const uint64_t ends[3] = {(uint64_t)base_x + x, (uint64_t)base_y + y, (uint64_t)base_z + z};
    check_workgroups("vkCmdDispatchBase", ends);
    device_of(commands)->next.cmd_dispatch_base(commands, base_x, base_y, base_z, x, y, z);
}

static VKAPI_ATTR void VKAPI_CALL cmd_dispatch_indirect(VkCommandBuffer commands, VkBuffer buffer,
                                                        VkDeviceSize offset) {
    if (shape.workgroups)
        REFUSE("workgroups cannot look into vkCmdDispatchIndirect");
    device_of(commands)->next.cmd_dispatch_indirect(commands, buffer, offset);
}

/* ---- Submissions and waits ---- */

enum fate { RUNS, HANGS, LOST };

/* Counts a submission, decides what becomes of it and marks its fence. */
static enum fate next_submission(device_t *device, VkQueue queue, VkFence fence) {
    enum fate fate = RUNS;
    pthread_mutex_lock(&device->lock);
    uint64_t number = ++device->submissions;
    if (device->is_lost || (shape.lose && number >= shape.lose)) {
        fate = LOST;
    } else if (shape.hang && number >= shape.hang) {
        fate = HANGS;
        device->is_hung = true;
        if (fence)
            object_put(device, FENCE, (uint64_t)fence)->ready_at = NEVER;
    } else if (shape.slow) {
        /* One after the other, as on a queue. */
        uint64_t now = now_ns(), start = device->busy_until > now ? device->busy_until : now;
        device->busy_until = start + shape.slow * NS_PER_MS;
        if (fence)
            object_put(device, FENCE, (uint64_t)fence)->ready_at = device->busy_until;
    }
    pthread_mutex_unlock(&device->lock);
    if (fate == LOST) {
        /* A lost device runs nothing, so the program may destroy what earlier submissions use: those must be over. */
        device->next.queue_wait_idle(queue);
        pthread_mutex_lock(&device->lock);
        device->is_lost = true;
        pthread_mutex_unlock(&device->lock);
    }
    return fate;
}

static bool is_lost(device_t *device) {
    pthread_mutex_lock(&device->lock);
    bool lost = device->is_lost;
    pthread_mutex_unlock(&device->lock);
    return lost;
}

static VKAPI_ATTR VkResult VKAPI_CALL queue_submit(VkQueue queue, uint32_t count, const VkSubmitInfo *submits,
                                                   VkFence fence) {
    device_t *device = device_of(queue);
    enum fate fate = next_submission(device, queue, fence);
    if (fate == RUNS)
        return device->next.queue_submit(queue, count, submits, fence);
    return fate == LOST ? VK_ERROR_DEVICE_LOST : VK_SUCCESS;
}

static VKAPI_ATTR VkResult VKAPI_CALL queue_submit2(VkQueue queue, uint32_t count, const VkSubmitInfo2 *submits,
                                                    VkFence fence) {
    device_t *device = device_of(queue);
    need_feature(SYNCHRONIZATION2, "vkQueueSubmit2");
    enum fate fate = next_submission(device, queue, fence);
    if (fate == RUNS)
        return device->next.queue_submit2(queue, count, submits, fence);
    return fate == LOST ? VK_ERROR_DEVICE_LOST : VK_SUCCESS;
}

static VKAPI_ATTR VkResult VKAPI_CALL queue_bind_sparse(VkQueue queue, uint32_t count, const VkBindSparseInfo *infos,
                                                        VkFence fence) {
    device_t *device = device_of(queue);
    enum fate fate = next_submission(device, queue, fence);
    if (fate == RUNS)
        return device->next.queue_bind_sparse(queue, count, infos, fence);
    return fate == LOST ? VK_ERROR_DEVICE_LOST : VK_SUCCESS;
}

/* Sleeps while the device pretends to be busy: for ever if it hangs. Tells whether it is lost. */
static bool sleep_while_busy(device_t *device) {
    for (;;) {
        pthread_mutex_lock(&device->lock);
        bool lost = device->is_lost;
        uint64_t until = device->is_hung ? NEVER : device->busy_until;
        pthread_mutex_unlock(&device->lock);
        uint64_t now = now_ns();
        if (lost || until <= now)
            return lost;
        sleep_slice(until - now);
    }
}

static VKAPI_ATTR VkResult VKAPI_CALL queue_wait_idle(VkQueue queue) {
    device_t *device = device_of(queue);
    bool lost = sleep_while_busy(device);
    VkResult result = device->next.queue_wait_idle(queue);
    return lost ? VK_ERROR_DEVICE_LOST : result;
}

static VKAPI_ATTR VkResult VKAPI_CALL device_wait_idle(VkDevice handle) {
    device_t *device = device_of(handle);
    bool lost = sleep_while_busy(device);
    VkResult result = device->next.device_wait_idle(handle);
    return lost ? VK_ERROR_DEVICE_LOST : result;
}

/* When a fence may be seen as signalled; 0 if it is not held back. The device is locked. */
static uint64_t ready_at(device_t *device, VkFence fence) {
    object_t *object = *object_place(device, FENCE, (uint64_t)fence);
    return object ? object->ready_at : 0;
}

static VKAPI_ATTR VkResult VKAPI_CALL wait_for_fences(VkDevice handle, uint32_t count, const VkFence *fences,
                                                      VkBool32 wait_all, uint64_t timeout) {
    device_t *device = device_of(handle);
    uint64_t now = now_ns(), deadline = timeout < NEVER - now ? now + timeout : NEVER;
    VkFence *ready = allocate_or_abort(count * sizeof *ready);
    VkResult result;
    for (;; now = now_ns()) {
        uint32_t ready_count = 0;
        uint64_t next_ready = NEVER, left = deadline == NEVER ? NEVER : deadline > now ? deadline - now : 0;
        pthread_mutex_lock(&device->lock);
        bool lost = device->is_lost;
        for (uint32_t i = 0; i < count; i++) {
            uint64_t at = ready_at(device, fences[i]);
            if (at <= now)
                ready[ready_count++] = fences[i];
            else
                next_ready = smaller(next_ready, at);
        }
        pthread_mutex_unlock(&device->lock);
        if (lost) {
            result = VK_ERROR_DEVICE_LOST;
            break;
        }
        if (ready_count == count) {
            result = device->next.wait_for_fences(handle, count, fences, wait_all, left);
            break;
        }
        if (ready_count && !wait_all) {
            result = device->next.wait_for_fences(handle, ready_count, ready, VK_FALSE, smaller(left, SLICE_NS));
            if (result != VK_TIMEOUT || left <= SLICE_NS)
                break;
        } else if (!left) {
            result = VK_TIMEOUT;
            break;
        } else {
            sleep_slice(smaller(left, next_ready - now));
        }
    }
    free(ready);
    return result;
}

static VKAPI_ATTR VkResult VKAPI_CALL fence_status(VkDevice handle, VkFence fence) {
    device_t *device = device_of(handle);
    pthread_mutex_lock(&device->lock);
    bool lost = device->is_lost, held = ready_at(device, fence) > now_ns();
    pthread_mutex_unlock(&device->lock);
    if (lost)
        return VK_ERROR_DEVICE_LOST;
    return held ? VK_NOT_READY : device->next.fence_status(handle, fence);
}

static VKAPI_ATTR VkResult VKAPI_CALL reset_fences(VkDevice handle, uint32_t count, const VkFence *fences) {
    device_t *device = device_of(handle);
    for (uint32_t i = 0; i < count; i++)
        forget(device, FENCE, (uint64_t)fences[i]);
    return device->next.reset_fences(handle, count, fences);
}

static VKAPI_ATTR void VKAPI_CALL destroy_fence(VkDevice handle, VkFence fence,
                                                const VkAllocationCallbacks *allocator) {
    device_t *device = device_of(handle);
    forget(device, FENCE, (uint64_t)fence);
    device->next.destroy_fence(handle, fence, allocator);
}

static VKAPI_ATTR VkResult VKAPI_CALL event_status(VkDevice handle, VkEvent event) {
    device_t *device = device_of(handle);
    return is_lost(device) ? VK_ERROR_DEVICE_LOST : device->next.event_status(handle, event);
}

static VKAPI_ATTR VkResult VKAPI_CALL query_pool_results(VkDevice handle, VkQueryPool pool, uint32_t first,
                                                         uint32_t count, size_t size, void *data, VkDeviceSize stride,
                                                         VkQueryResultFlags flags) {
    device_t *device = device_of(handle);
    if (is_lost(device))
        return VK_ERROR_DEVICE_LOST;
    return device->next.query_pool_results(handle, pool, first, count, size, data, stride, flags);
}

/* Semaphores are not held back by `slow`; what a submission that hangs would signal is never signalled. */
static VKAPI_ATTR VkResult VKAPI_CALL wait_semaphores(VkDevice handle, const VkSemaphoreWaitInfo *info,
                                                      uint64_t timeout) {
    device_t *device = device_of(handle);
    return is_lost(device) ? VK_ERROR_DEVICE_LOST : device->next.wait_semaphores(handle, info, timeout);
}

static VKAPI_ATTR VkResult VKAPI_CALL semaphore_counter_value(VkDevice handle, VkSemaphore semaphore, uint64_t *value) {
    device_t *device = device_of(handle);
    return is_lost(device) ? VK_ERROR_DEVICE_LOST : device->next.semaphore_counter_value(handle, semaphore, value);
}

/* ---- Creation and destruction ---- */

/* A name with KHR at its end. */
typedef struct {
    char text[128];
} alias_t;

static alias_t alias_of(const char *name) {
    alias_t alias;
    snprintf(alias.text, sizeof alias.text, "%sKHR", name);
    return alias;
}

static VKAPI_ATTR VkResult VKAPI_CALL create_instance(const VkInstanceCreateInfo *info,
                                                      const VkAllocationCallbacks *allocator, VkInstance *handle) {
    static pthread_once_t once = PTHREAD_ONCE_INIT;
    pthread_once(&once, read_shape);
    VkLayerInstanceCreateInfo *link = (VkLayerInstanceCreateInfo *)info->pNext;
    while (link &&
           (link->sType != VK_STRUCTURE_TYPE_LOADER_INSTANCE_CREATE_INFO || link->function != VK_LAYER_LINK_INFO))
        link = (VkLayerInstanceCreateInfo *)link->pNext;
    if (!link)
        return VK_ERROR_INITIALIZATION_FAILED;
    PFN_vkGetInstanceProcAddr next = link->u.pLayerInfo->pfnNextGetInstanceProcAddr;
    link->u.pLayerInfo = link->u.pLayerInfo->pNext;
    VkResult result = ((PFN_vkCreateInstance)next(VK_NULL_HANDLE, "vkCreateInstance"))(info, allocator, handle);
    if (result != VK_SUCCESS)
        return result;
    instance_t *instance = allocate_or_abort(sizeof *instance);
    instance->key = key_of(*handle);
    instance->handle = *handle;
    instance->instance_function = next;
    /* Later the loader would answer with the layer's own functions. */
#define LOAD(name, here)                                                                                               \
    instance->next.here = (PFN_vk##name)next(*handle, "vk" #name);                                                     \
    if (!instance->next.here)                                                                                          \
        instance->next.here = (PFN_vk##name)next(*handle, alias_of("vk" #name).text);
    INSTANCE_FUNCTIONS(LOAD)
#undef LOAD
    pthread_mutex_lock(&registry_lock);
    instance->next_instance = instances;
    instances = instance;
    pthread_mutex_unlock(&registry_lock);
    return VK_SUCCESS;
}

static VKAPI_ATTR void VKAPI_CALL destroy_instance(VkInstance handle, const VkAllocationCallbacks *allocator) {
    if (!handle)
        return;
    instance_t *instance = instance_of(handle);
    /* Before the loader frees the key, which another thread's new instance may get. */
    pthread_mutex_lock(&registry_lock);
    instance_t **place = &instances;
    while (*place != instance)
        place = &(*place)->next_instance;
    *place = instance->next_instance;
    pthread_mutex_unlock(&registry_lock);
    instance->next.destroy_instance(handle, allocator);
    free(instance);
}

/* A driver refuses features that it does not have. */
static bool wants_hidden_feature(const VkDeviceCreateInfo *info) {
    for (VkBaseOutStructure *part = (VkBaseOutStructure *)info->pNext; part; part = part->pNext) {
        for (int feature = 0; feature < FEATURE_COUNT; feature++) {
            const VkBool32 *place = feature_in(part, feature);
            if (place && *place && shape.hides[feature]) {
                say("vkCreateDevice: the device has no %s", feature_names[feature]);
                return true;
            }
        }
    }
    return false;
}

static VKAPI_ATTR VkResult VKAPI_CALL create_device(VkPhysicalDevice physical, const VkDeviceCreateInfo *info,
                                                    const VkAllocationCallbacks *allocator, VkDevice *handle) {
    instance_t *instance = instance_of(physical);
    VkLayerDeviceCreateInfo *link = (VkLayerDeviceCreateInfo *)info->pNext;
    while (link &&
           (link->sType != VK_STRUCTURE_TYPE_LOADER_DEVICE_CREATE_INFO || link->function != VK_LAYER_LINK_INFO))
        link = (VkLayerDeviceCreateInfo *)link->pNext;
    if (!link)
        return VK_ERROR_INITIALIZATION_FAILED;
    if (wants_hidden_feature(info))
        return VK_ERROR_FEATURE_NOT_PRESENT;
    PFN_vkGetInstanceProcAddr next_instance_function = link->u.pLayerInfo->pfnNextGetInstanceProcAddr;
    PFN_vkGetDeviceProcAddr next = link->u.pLayerInfo->pfnNextGetDeviceProcAddr;
    link->u.pLayerInfo = link->u.pLayerInfo->pNext;
    PFN_vkCreateDevice create = (PFN_vkCreateDevice)next_instance_function(instance->handle, "vkCreateDevice");
    if (!create)
        return VK_ERROR_INITIALIZATION_FAILED;
    VkResult result = create(physical, info, allocator, handle);
    if (result != VK_SUCCESS)
        return result;
    device_t *device = allocate_or_abort(sizeof *device);
    device->key = key_of(*handle);
    device->device_function = next;
    pthread_mutex_init(&device->lock, NULL);
    instance->next.memory_properties(physical, &device->memory);
#define LOAD(name, here)                                                                                               \
    device->next.here = (PFN_vk##name)next(*handle, "vk" #name);                                                       \
    if (!device->next.here)                                                                                            \
        device->next.here = (PFN_vk##name)next(*handle, alias_of("vk" #name).text);
    DEVICE_FUNCTIONS(LOAD)
#undef LOAD
    pthread_mutex_lock(&registry_lock);
    device->next_device = devices;
    devices = device;
    pthread_mutex_unlock(&registry_lock);
    return VK_SUCCESS;
}

static VKAPI_ATTR void VKAPI_CALL destroy_device(VkDevice handle, const VkAllocationCallbacks *allocator) {
    if (!handle)
        return;
    device_t *device = device_of(handle);
    pthread_mutex_lock(&registry_lock);
    device_t **place = &devices;
    while (*place != device)
        place = &(*place)->next_device;
    *place = device->next_device;
    pthread_mutex_unlock(&registry_lock);
    device->next.destroy_device(handle, allocator);
    for (int bucket = 0; bucket < BUCKET_COUNT; bucket++) {
        while (device->objects[bucket]) {
            object_t *object = device->objects[bucket];
            device->objects[bucket] = object->next_object;
            free(object);
        }
    }
    pthread_mutex_destroy(&device->lock);
    free(device);
}

/* ---- What the loader and the layer above ask for ---- */

typedef struct {
    const char *name;
    PFN_vkVoidFunction function;
} entry_t;

#define ENTRY(name, here) {"vk" #name, (PFN_vkVoidFunction)here},
static const entry_t instance_entries[] = {INSTANCE_FUNCTIONS(ENTRY)};
static const entry_t device_entries[] = {DEVICE_FUNCTIONS(ENTRY)};

static PFN_vkVoidFunction find_entry(const entry_t *entries, size_t count, const char *name) {
    for (size_t i = 0; i < count; i++)
        if (!strcmp(name, entries[i].name) || !strcmp(name, alias_of(entries[i].name).text))
            return entries[i].function;
    return NULL;
}

static VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL device_function(VkDevice handle, const char *name) {
    if (!strcmp(name, "vkGetDeviceProcAddr"))
        return (PFN_vkVoidFunction)device_function;
    PFN_vkVoidFunction next = device_of(handle)->device_function(handle, name);
    PFN_vkVoidFunction here = find_entry(device_entries, COUNT_OF(device_entries), name);
    /* What the driver does not have, a program must not find. */
    return next && here ? here : next;
}

static VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL instance_function(VkInstance handle, const char *name) {
    if (!strcmp(name, "vkGetInstanceProcAddr"))
        return (PFN_vkVoidFunction)instance_function;
    if (!strcmp(name, "vkCreateInstance"))
        return (PFN_vkVoidFunction)create_instance;
    if (!handle)
        return NULL;
    if (!strcmp(name, "vkGetDeviceProcAddr"))
        return (PFN_vkVoidFunction)device_function;
    PFN_vkVoidFunction here = find_entry(device_entries, COUNT_OF(device_entries), name);
    if (here)
        return here;
    PFN_vkVoidFunction next = instance_of(handle)->instance_function(handle, name);
    here = find_entry(instance_entries, COUNT_OF(instance_entries), name);
    return next && here ? here : next;
}

EXPORT VKAPI_ATTR VkResult VKAPI_CALL vkNegotiateLoaderLayerInterfaceVersion(VkNegotiateLayerInterface *interface) {
    if (interface->loaderLayerInterfaceVersion < 2)
        return VK_ERROR_INITIALIZATION_FAILED;
    interface->loaderLayerInterfaceVersion = 2;
    interface->pfnGetInstanceProcAddr = instance_function;
    interface->pfnGetDeviceProcAddr = device_function;
    /* The layer knows no function of physical devices that the loader does not know. */
    interface->pfnGetPhysicalDeviceProcAddr = NULL;
    return VK_SUCCESS;
}
