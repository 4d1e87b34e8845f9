// SPDX-License-Identifier: Apache-2.0
#pragma once

// Builders for the tables of the schema_*.cpp sources (not installed): a key is built from a chain of
// pointers to members, which determines its kind and the accessor to its value.

#include <array>
#include <filesystem>
#include <optional>
#include <type_traits>
#include <utility>

#include "scenes/format/schema.h"
#include "seeds/model.h"

namespace nephos::schema_build {

template <typename Pointer>
struct MemberOf;
template <typename Owner, typename Value>
struct MemberOf<Value Owner::*> {
    using owner_type = Owner;
    using value_type = Value;
};

template <auto First, auto... Rest>
struct Chain {
    using owner_type = typename MemberOf<decltype(First)>::owner_type;
    using value_type = typename Chain<Rest...>::value_type;
    static value_type& of(owner_type& owner) { return Chain<Rest...>::of(owner.*First); }
};
template <auto Only>
struct Chain<Only> {
    using owner_type = typename MemberOf<decltype(Only)>::owner_type;
    using value_type = typename MemberOf<decltype(Only)>::value_type;
    static value_type& of(owner_type& owner) { return owner.*Only; }
};

// Returns the value behind a chain of members of an owner.
template <auto... Members>
void* value_at(void* owner) {
    using Path = Chain<Members...>;
    return &Path::of(*static_cast<typename Path::owner_type*>(owner));
}

inline void* whole_owner(void* owner) { return owner; }

template <typename T>
constexpr KeyKind kind_of() {
    if constexpr (std::is_same_v<T, bool>)
        return KeyKind::boolean;
    else if constexpr (std::is_same_v<T, int>)
        return KeyKind::integer;
    else if constexpr (std::is_same_v<T, std::uint64_t>)
        return KeyKind::count;
    else if constexpr (std::is_same_v<T, double>)
        return KeyKind::number;
    else if constexpr (std::is_same_v<T, std::string>)
        return KeyKind::text;
    else if constexpr (std::is_same_v<T, std::optional<std::filesystem::path>>)
        return KeyKind::path;
    else if constexpr (std::is_same_v<T, Extent>)
        return KeyKind::extent;
    else if constexpr (std::is_same_v<T, Vec3>)
        return KeyKind::vector;
    else if constexpr (std::is_same_v<T, std::array<double, 3>>)
        return KeyKind::colour;
    else if constexpr (std::is_same_v<T, Range>)
        return KeyKind::range;
    else if constexpr (std::is_same_v<T, CountRange>)
        return KeyKind::counts;
    else if constexpr (std::is_same_v<T, std::vector<std::string>>)
        return KeyKind::texts;
    else if constexpr (std::is_same_v<T, Boundaries>)
        return KeyKind::boundaries;
    else
        static_assert(!sizeof(T), "no kind of key for this type");
}

inline Key plain_key(KeyKind kind, std::string name, std::string unit, Limits limits, std::string effect,
                     std::string source) {
    Key key;
    key.kind = kind;
    key.name = std::move(name);
    key.unit = std::move(unit);
    key.limits = limits;
    key.effect = std::move(effect);
    key.source = std::move(source);
    return key;
}

template <auto... Members>
Key key(std::string name, std::string unit, Limits limits, std::string effect, std::string source = {}) {
    constexpr KeyKind kind = kind_of<typename Chain<Members...>::value_type>();
    Key made =
        plain_key(kind, std::move(name), std::move(unit), limits, std::move(effect), std::move(source));
    made.value = &value_at<Members...>;
    return made;
}

// Builds a key for all 64 bits of a std::uint64_t; key() is limited to the range of a TOML integer.
template <auto... Members>
Key seed_key(std::string name, std::string effect) {
    static_assert(std::is_same_v<typename Chain<Members...>::value_type, std::uint64_t>);
    Key made = plain_key(KeyKind::seed, std::move(name), {}, {}, std::move(effect), {});
    made.value = &value_at<Members...>;
    return made;
}

// Builds a key without accessor for a number that Section::finish reads.
inline Key derived_number(std::string name, std::string unit, Limits limits, std::string effect) {
    return plain_key(KeyKind::number, std::move(name), std::move(unit), limits, std::move(effect), {});
}

template <auto... Members>
Key word(std::string name, std::vector<std::string_view> words, std::string effect, std::string source = {}) {
    using Word = typename Chain<Members...>::value_type;
    static_assert(std::is_enum_v<Word>);
    Key made = plain_key(KeyKind::word, std::move(name), {}, {}, std::move(effect), std::move(source));
    made.words = std::move(words);
    made.value = &value_at<Members...>;
    made.word_index = [](const void* value) { return int(*static_cast<const Word*>(value)); };
    made.set_word = [](void* value, int index) { *static_cast<Word*>(value) = Word(index); };
    return made;
}

// Builds a key for a genus by its abbreviation, or "none".
template <auto... Members>
Key genus_word(std::string name, std::string effect, std::string source = {}) {
    static_assert(std::is_same_v<typename Chain<Members...>::value_type, std::optional<Genus>>);
    Key made = plain_key(KeyKind::word, std::move(name), {}, {}, std::move(effect), std::move(source));
    made.words.push_back("none");
    for (const GenusFacts& facts : genera()) made.words.push_back(facts.abbreviation);
    made.value = &value_at<Members...>;
    made.word_index = [](const void* value) {
        const auto& genus = *static_cast<const std::optional<Genus>*>(value);
        return genus ? int(*genus) + 1 : 0;
    };
    made.set_word = [](void* value, int index) {
        auto& genus = *static_cast<std::optional<Genus>*>(value);
        genus = index == 0 ? std::nullopt : std::optional(Genus(index - 1));
    };
    return made;
}

inline Key with_section(KeyKind kind, std::string name, const Section& section) {
    Key made = plain_key(kind, std::move(name), {}, {}, section.effect, {});
    made.section = &section;
    return made;
}

// Builds a table whose keys have the same owner.
inline Key group(std::string name, const Section& section) {
    Key made = with_section(KeyKind::table, std::move(name), section);
    made.value = &whole_owner;
    return made;
}

// Builds a table whose owner is a member.
template <auto... Members>
Key table(std::string name, const Section& section, std::string effect) {
    Key made = with_section(KeyKind::table, std::move(name), section);
    made.effect = std::move(effect);
    made.value = &value_at<Members...>;
    return made;
}

// Returns the defaults of a new element of an array of tables: those of its type, but for the types below, which are declared here
// so that each use of tables() takes the same.
template <typename Element>
const Element& default_element() {
    static const Element element{};
    return element;
}
template <>
const EllipsoidScatter& default_element<EllipsoidScatter>();  // in schema_automaton.cpp
template <>
const WindField& default_element<WindField>();  // in schema_wind.cpp

template <auto... Members>
Key tables(std::string name, const Section& section, int min_items, int max_items) {
    using Vector = typename Chain<Members...>::value_type;
    using Element = typename Vector::value_type;
    Key made = with_section(KeyKind::tables, std::move(name), section);
    made.min_items = min_items;
    made.max_items = max_items;
    made.value = &value_at<Members...>;
    made.element_defaults = &default_element<Element>();
    made.append = [](void* vector) -> void* {
        return &static_cast<Vector*>(vector)->emplace_back(default_element<Element>());
    };
    made.size = [](const void* vector) { return static_cast<const Vector*>(vector)->size(); };
    made.element = [](const void* vector, std::size_t index) -> const void* {
        return &(*static_cast<const Vector*>(vector))[index];
    };
    return made;
}

inline Key required(Key key) {
    key.required = true;
    return key;
}

inline Key default_is(Key key, std::string text) {
    key.default_text = std::move(text);
    return key;
}

inline Key together(Key key, std::vector<std::string> with) {
    key.together_with = std::move(with);
    return key;
}

// Builds a key that the canonical scene omits, so that its hash is that of a scene without it, unless
// `is_written`.
inline Key written_if(Key key, bool (*is_written)(const void* owner)) {
    key.written = is_written;
    return key;
}

inline Key replaced(Key key, std::string by) {
    key.replaced_by = std::move(by);
    return key;
}

inline constexpr Limits kAny{};
constexpr Limits between(double min, double max) { return {min, max}; }
constexpr Limits above(double min, double max) { return {min, max, true}; }
constexpr Limits or_infinite(Limits limits) {
    limits.max = std::numeric_limits<double>::infinity();
    limits.infinite = true;
    return limits;
}

// A key of Scene::render. `Members`: the way from RenderOptions to the option.
template <auto... Members>
Key render_key(std::string name, std::string unit, Limits limits, std::string effect,
               std::string source = {}) {
    return key<&Scene::render, Members...>(std::move(name), std::move(unit), limits, std::move(effect),
                                           std::move(source));
}

}  // namespace nephos::schema_build
