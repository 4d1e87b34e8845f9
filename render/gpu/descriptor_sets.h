// SPDX-License-Identifier: Apache-2.0
#pragma once

// Descriptor sets by pass: each pipeline has a layout with the bindings that its own shaders use, read from their
// SPIR-V, and a set of it is filled when the pipeline is recorded. Whoever records names the resources of all passes
// that it runs once, by number; a pass takes those that it declares. Private to the module.

#include <cstdint>
#include <initializer_list>
#include <span>
#include <vector>

#include "render/gpu/gpu_resources.h"

namespace nephos {

// SPIR-V words, embedded at build time.
using ShaderCode = std::span<const std::uint32_t>;

// A binding of set 0 that shaders use.
struct ShaderBinding {
    std::uint32_t number = 0;
    vk::DescriptorType type{};
    bool operator==(const ShaderBinding&) const = default;
};

// Returns the bindings that the functions of a shader read or write; in rising order.
std::vector<ShaderBinding> bindings_of(ShaderCode code);

// What is bound to a number: a buffer, a storage image, or an image with its sampler. It holds handles, which are
// invalid as soon as the buffer or image is made anew.
struct Resource {
    Resource(std::uint32_t n, const GpuBuffer& of) : number(n), buffer(*of.buffer), bytes(of.bytes) {}
    Resource(std::uint32_t n, const GpuImage& of) : number(n), view(*of.view) {}
    Resource(std::uint32_t n, const GpuImage& of, const vk::raii::Sampler& with)
        : number(n), view(*of.view), sampler(*with) {}

    std::uint32_t number;
    vk::Buffer buffer;
    vk::DeviceSize bytes = 0;
    vk::ImageView view;
    vk::Sampler sampler;
};

// Resources by number, one each.
class Resources {
  public:
    Resources() = default;
    Resources(std::initializer_list<Resource> some) { set(some); }
    // Sets resources, in the place of those that had their numbers.
    void set(std::span<const Resource> some);
    void set(std::initializer_list<Resource> some) { set(std::span(some.begin(), some.size())); }
    void set(const Resources& others) { set(others.all_); }
    Resources with(std::initializer_list<Resource> some) const;
    const Resource* find(std::uint32_t number) const;

  private:
    std::vector<Resource> all_;
};

struct Pipeline;

// Sets for the commands of one submission. Not thread-safe.
class DescriptorSets {
  public:
    explicit DescriptorSets(const GpuDevice& gpu) : gpu_(&gpu) {}

    // Returns a set with the resources that a pipeline uses, valid until reset(). All of them must be there: lavapipe
    // (Mesa 22.3) reads even samplers that no lane uses.
    vk::DescriptorSet fill(const Pipeline& pipeline, const Resources& resources);
    // Takes all sets back; nothing that uses them may be in flight.
    void reset();

  private:
    vk::DescriptorSet allocate(const Pipeline& pipeline);

    const GpuDevice* gpu_;
    std::vector<vk::raii::DescriptorPool> pools_;
    std::size_t used_ = 0;  // sets
};

}  // namespace nephos
