// SPDX-License-Identifier: Apache-2.0
#include "scenes/format/toml_tree.h"

#include <algorithm>
#include <utility>

namespace nephos {
namespace {

constexpr std::string_view kBlanks = " \t";
constexpr std::size_t kNone = std::string_view::npos;

// One part of a key: without its quotes, and as it stands.
struct KeyPart {
    std::string name, text;
};
using Names = std::vector<KeyPart>;

class TreeBuilder {
  public:
    explicit TreeBuilder(std::string_view text) : text_(text) {
        if (text_.starts_with("\xEF\xBB\xBF")) at_ = 3;
        root_.form = TomlNode::Form::section;
        root_.headers.push_back({at_, at_});
        root_.places.push_back({at_, at_});
        root_.insert_at = at_;
    }

    TomlNode build() {
        TomlNode* table = &root_;
        while (true) {
            skip_space_and_comments();
            if (at_ >= text_.size()) break;
            if (text_[at_] == '[') {
                table = &open_section();
            } else if (!add_statement(*table)) {
                break;  // not TOML
            }
        }
        return std::move(root_);
    }

  private:
    bool at_end() const { return at_ >= text_.size(); }
    char peek() const { return at_end() ? '\0' : text_[at_]; }

    std::size_t line_begin(std::size_t at) const {
        const std::size_t newline = at == 0 ? kNone : text_.rfind('\n', at - 1);
        const std::size_t begin = newline == kNone ? 0 : newline + 1;
        return begin == 0 && text_.starts_with("\xEF\xBB\xBF") ? 3 : begin;
    }
    std::size_t line_end(std::size_t at) const {  // after its newline
        const std::size_t newline = text_.find('\n', at);
        return newline == kNone ? text_.size() : newline + 1;
    }

    void skip_blanks() { at_ = std::min(text_.find_first_not_of(kBlanks, at_), text_.size()); }
    void skip_space_and_comments() {
        while (!at_end()) {
            at_ = std::min(text_.find_first_not_of(" \t\r\n", at_), text_.size());
            if (peek() != '#') return;
            at_ = std::min(text_.find('\n', at_), text_.size());
        }
    }

    // Goes past the string that begins at `at_`.
    void skip_string() {
        const char quote = text_[at_];
        const std::string_view triple = quote == '"' ? "\"\"\"" : "'''";
        const bool several_lines = text_.substr(at_, 3) == triple;
        at_ += several_lines ? 3 : 1;
        while (!at_end()) {
            if (text_[at_] == '\\' && quote == '"') {
                at_ = std::min(at_ + 2, text_.size());
            } else if (several_lines && text_.substr(at_, 3) == triple) {
                at_ += 3;
                for (int n = 0; n < 2 && peek() == quote; ++n) ++at_;  // quotes before the closing three
                return;
            } else if (text_[at_++] == quote && !several_lines) {
                return;
            }
        }
    }

    // Reads one part of a key. Escapes in quoted keys stay as they are: no key of a scene has any.
    KeyPart key_part() {
        const std::size_t begin = at_;
        if (peek() == '"' || peek() == '\'') {
            skip_string();
            return {std::string(text_.substr(begin + 1, at_ - begin - 2)),
                    std::string(text_.substr(begin, at_ - begin))};
        }
        while (!at_end()) {
            const char c = text_[at_];
            const bool letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
            if (!letter && c != '_' && c != '-') break;
            ++at_;
        }
        const std::string name(text_.substr(begin, at_ - begin));
        return {name, name};
    }

    Names key() {
        Names names;
        while (true) {
            skip_blanks();
            names.push_back(key_part());
            skip_blanks();
            if (peek() != '.') return names;
            ++at_;
        }
    }

    TomlNode parsed_value() {
        TomlNode node;
        const std::size_t begin = at_;
        const char c = peek();
        if (c == '[') {
            node.form = TomlNode::Form::array;
            read_items(node);
        } else if (c == '{') {
            node.form = TomlNode::Form::inlined;
            read_braces(node);
        } else if (c == '"' || c == '\'') {
            skip_string();
        } else {
            at_ = std::min(text_.find_first_of(",]}#\r\n", at_), text_.size());
            while (at_ > begin && kBlanks.find(text_[at_ - 1]) != kNone) --at_;
        }
        node.value = {begin, at_};
        return node;
    }

    void read_items(TomlNode& array) {
        ++at_;
        while (true) {
            skip_space_and_comments();
            if (at_end()) return;
            if (peek() == ']') break;
            const std::size_t before = at_;
            TomlNode item = parsed_value();
            if (at_ == before) return;
            item.places.push_back(item.value);
            array.items.push_back(std::move(item));
            skip_space_and_comments();
            if (peek() == ',') ++at_;
        }
        ++at_;
    }

    void read_braces(TomlNode& table) {
        ++at_;
        table.insert_at = at_;
        while (true) {
            skip_space_and_comments();
            if (at_end()) return;
            if (peek() == '}') break;
            const std::size_t begin = at_;
            const Names names = key();
            if (peek() != '=') return;
            ++at_;
            skip_blanks();
            TomlNode node = parsed_value();
            node.places.push_back({begin, at_});
            table.insert_at = at_;
            place(table, names, std::move(node), at_, true);
            skip_space_and_comments();
            if (peek() == ',') ++at_;
        }
        ++at_;
    }

    // Returns false where there is none.
    bool add_statement(TomlNode& table) {
        const std::size_t begin = line_begin(at_);
        const Names names = key();
        if (peek() != '=') return false;
        ++at_;
        skip_blanks();
        TomlNode node = parsed_value();
        at_ = after_ = line_end(at_);
        node.places.push_back({begin, at_});
        table.insert_at = at_;
        if (!table.places.empty()) table.places.back().end = at_;
        if (!table.headers.empty()) table.headers.back().end = at_;
        place(table, names, std::move(node), at_, false);
        return true;
    }

    // Puts a value at a dotted key of a table and notes its place in the tables on the way.
    static void place(TomlNode& table, const Names& names, TomlNode node, std::size_t after, bool in_braces) {
        TomlNode* to = &table;
        std::string prefix;
        for (std::size_t n = 0; n + 1 < names.size(); ++n) {
            prefix += names[n].text + ".";
            TomlNode* next = to->find(names[n].name);
            if (next == nullptr) {
                next = &to->entries.emplace_back(TomlEntry{names[n].name, {}}).value;
                next->form = TomlNode::Form::dotted;
                next->prefix = prefix;
                next->in_braces = in_braces;
            }
            next->places.push_back(node.places.front());
            next->insert_at = after;
            to = next;
        }
        to->entries.push_back({names.back().name, std::move(node)});
    }

    // Where the comment directly above a header begins; one at the start of the file is the file's own.
    std::size_t with_comment_above(std::size_t header) const {
        std::size_t begin = header;
        while (begin > 0) {
            const std::size_t above = line_begin(begin - 1);
            const std::size_t first = text_.find_first_not_of(kBlanks, above);
            if (above >= begin || above < after_ || first == kNone || text_[first] != '#') return begin;
            if (above == 0 || (above == 3 && text_.starts_with("\xEF\xBB\xBF"))) return header;
            begin = above;
        }
        return begin;
    }

    TomlNode& open_section() {
        const std::size_t header = line_begin(at_);
        const bool element = text_.substr(at_, 2) == "[[";
        at_ += element ? 2 : 1;
        const Names names = key();
        at_ = line_end(at_);
        TomlNode* to = &root_;
        for (std::size_t n = 0; n < names.size(); ++n) {
            const bool last = n + 1 == names.size();
            TomlNode* next = to->find(names[n].name);
            if (next == nullptr) {
                next = &to->entries.emplace_back(TomlEntry{names[n].name, {}}).value;
                next->form = last && element ? TomlNode::Form::sections : TomlNode::Form::section;
            }
            if (next->form == TomlNode::Form::sections || next->form == TomlNode::Form::array) {
                if (last && element) {
                    next->items.emplace_back().form = TomlNode::Form::section;
                }
                if (next->items.empty()) return root_;  // not TOML
                next = &next->items.back();
            }
            to = next;
        }
        to->places.push_back({with_comment_above(header), at_});
        after_ = at_;
        to->headers.push_back({header, at_});
        to->insert_at = at_;
        return *to;
    }

    std::string_view text_;
    std::size_t at_ = 0,
                after_ = 0;  // the latter behind the last statement or header: what is above is no comment
    TomlNode root_;
};

}  // namespace

const TomlNode* TomlNode::find(std::string_view name) const {
    const auto found = std::ranges::find(entries, name, &TomlEntry::name);
    return found == entries.end() ? nullptr : &found->value;
}

TomlNode* TomlNode::find(std::string_view name) {
    return const_cast<TomlNode*>(std::as_const(*this).find(name));
}

TomlNode toml_tree(std::string_view text) { return TreeBuilder(text).build(); }

}  // namespace nephos
