// SPDX-License-Identifier: Apache-2.0
#include "render/gpu/descriptor_sets.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <map>

#include "render/gpu/gpu_pipeline.h"

namespace nephos {
namespace {

constexpr std::uint32_t kSetsInPool = 128;
constexpr std::uint32_t kMostOthers = 4;  // bindings of a pass, of each type but storage buffers

// The instructions of SPIR-V that tell which variables are bound where and which of them are used (Khronos, SPIR-V
// 1.6, sections 3.49.8 ff.).
enum class Op : std::uint32_t {
    type_image = 25,
    type_pointer = 32,
    function_call = 57,
    variable = 59,
    image_texel_pointer = 60,
    load = 61,
    store = 62,
    access_chain = 65,
    in_bounds_access_chain = 66,
    array_length = 68,
    decorate = 71,
};
constexpr std::uint32_t kDecorationBinding = 33;
enum class Storage : std::uint32_t { uniform_constant = 0, uniform = 2, storage_buffer = 12 };

// Calls visit(op, words) for all instructions; words: of the instruction, the first has opcode and count.
template <class Visit>
void for_each_instruction(ShaderCode code, const Visit& visit) {
    for (std::size_t at = 5; at < code.size();) {  // behind the header
        const std::size_t count = code[at] >> 16;
        visit(Op(code[at] & 0xffffu), code.subspan(at, count));
        at += count;
    }
}

// Variables and types of a shader, by their ids.
struct ShaderIds {
    std::map<std::uint32_t, std::uint32_t> binding;  // of variables
    std::map<std::uint32_t, vk::DescriptorType> type;
    std::map<std::uint32_t, std::uint32_t> pointee;
    std::map<std::uint32_t, bool> used;
    std::map<std::uint32_t, bool> is_storage_image;  // of types of images

    void read(Op op, ShaderCode words) {
        const auto use = [&](std::uint32_t id) { used[id] = true; };
        switch (op) {
            case Op::decorate:
                if (words[2] == kDecorationBinding) binding[words[1]] = words[3];
                break;
            case Op::type_image:
                is_storage_image[words[1]] = words[7] == 2;
                break;
            case Op::type_pointer:
                pointee[words[1]] = words[3];
                break;
            case Op::variable:
                type[words[2]] = type_of(words[1], Storage(words[3]));
                break;
            case Op::store:
                use(words[1]);
                break;
            case Op::load:
            case Op::access_chain:
            case Op::in_bounds_access_chain:
            case Op::array_length:
            case Op::image_texel_pointer:
                use(words[3]);
                break;
            case Op::function_call:
                for (const std::uint32_t id : words.subspan(4)) use(id);
                break;
        }
    }

    vk::DescriptorType type_of(std::uint32_t pointer, Storage storage) const {
        if (storage == Storage::storage_buffer) return vk::DescriptorType::eStorageBuffer;
        if (storage == Storage::uniform) return vk::DescriptorType::eUniformBuffer;
        const auto image = is_storage_image.find(pointee.at(pointer));
        return image != is_storage_image.end() && image->second ? vk::DescriptorType::eStorageImage
                                                                : vk::DescriptorType::eCombinedImageSampler;
    }
};

vk::raii::DescriptorPool create_pool(const GpuDevice& gpu) {
    using Type = vk::DescriptorType;
    const std::array sizes{vk::DescriptorPoolSize(Type::eStorageBuffer, kSetsInPool * kMostStorageBuffers),
                           vk::DescriptorPoolSize(Type::eUniformBuffer, kSetsInPool * kMostOthers),
                           vk::DescriptorPoolSize(Type::eCombinedImageSampler, kSetsInPool * kMostOthers),
                           vk::DescriptorPoolSize(Type::eStorageImage, kSetsInPool * kMostOthers)};
    return {gpu.device, vk::DescriptorPoolCreateInfo({}, kSetsInPool, sizes)};
}

}  // namespace

std::vector<ShaderBinding> bindings_of(ShaderCode code) {
    ShaderIds ids;
    for_each_instruction(code, [&](Op op, ShaderCode words) { ids.read(op, words); });
    std::vector<ShaderBinding> bindings;
    for (const auto& [id, number] : ids.binding)
        if (ids.used.contains(id)) bindings.push_back({number, ids.type.at(id)});
    std::ranges::sort(bindings, {}, &ShaderBinding::number);
    // Blocks that name one buffer twice, as different types.
    bindings.erase(std::unique(bindings.begin(), bindings.end()), bindings.end());
    return bindings;
}

void Resources::set(std::span<const Resource> some) {
    for (const Resource& each : some) {
        const auto known = std::ranges::find(all_, each.number, &Resource::number);
        if (known == all_.end())
            all_.push_back(each);
        else
            *known = each;
    }
}

Resources Resources::with(std::initializer_list<Resource> some) const {
    Resources both = *this;
    both.set(some);
    return both;
}

const Resource* Resources::find(std::uint32_t number) const {
    const auto found = std::ranges::find(all_, number, &Resource::number);
    return found == all_.end() ? nullptr : &*found;
}

vk::DescriptorSet DescriptorSets::allocate(const Pipeline& pipeline) {
    const std::size_t pool = used_ / kSetsInPool;
    if (pool == pools_.size()) pools_.push_back(create_pool(*gpu_));
    // Allocated without RAII: the set goes with its pool.
    vk::DescriptorSet set;
    const vk::Device device = *gpu_->device;
    const vk::DescriptorSetAllocateInfo info(*pools_[pool], *pipeline.set_layout);
    const vk::Result result = device.allocateDescriptorSets(&info, &set, *gpu_->device.getDispatcher());
    if (result != vk::Result::eSuccess) fail_gpu("allocating descriptors", result);
    ++used_;
    return set;
}

vk::DescriptorSet DescriptorSets::fill(const Pipeline& pipeline, const Resources& resources) {
    const vk::DescriptorSet set = allocate(pipeline);
    const std::size_t count = pipeline.bindings.size();
    std::vector<vk::DescriptorBufferInfo> buffers(count);
    std::vector<vk::DescriptorImageInfo> images(count);
    std::vector<vk::WriteDescriptorSet> writes;
    for (std::size_t i = 0; i < count; ++i) {
        const auto [number, type] = pipeline.bindings[i];
        const Resource* const resource = resources.find(number);
        assert(resource != nullptr);
        vk::WriteDescriptorSet& write = writes.emplace_back(set, number, 0, 1, type);
        if (resource->buffer) {
            // Shaders see no more of a buffer than the device allows.
            const vk::DeviceSize seen =
                type == vk::DescriptorType::eStorageBuffer
                    ? std::min<vk::DeviceSize>(resource->bytes, gpu_->properties.limits.maxStorageBufferRange)
                    : VK_WHOLE_SIZE;
            buffers[i] = vk::DescriptorBufferInfo(resource->buffer, 0, seen);
            write.pBufferInfo = &buffers[i];
        } else {
            images[i] = vk::DescriptorImageInfo(resource->sampler, resource->view, vk::ImageLayout::eGeneral);
            write.pImageInfo = &images[i];
        }
    }
    gpu_->device.updateDescriptorSets(writes, {});
    return set;
}

void DescriptorSets::reset() {
    for (const vk::raii::DescriptorPool& pool : pools_) pool.reset();
    used_ = 0;
}

}  // namespace nephos
