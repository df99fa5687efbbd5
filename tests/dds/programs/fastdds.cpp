// A Fast DDS 2.9 process under remote control (tests/dds/peers.py starts it; tools/setup.sh compiles it).
//
// The lines and commands are those of ros.py as far as topics go. Messages are bytes whose CDR is written here by
// hand: std_msgs String ({"data": text}) and UInt8MultiArray (publish_bytes).

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <cstring>
#include <functional>
#include <iostream>
#include <map>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/Topic.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>

using namespace eprosima::fastdds::dds;
using eprosima::fastrtps::rtps::SerializedPayload_t;
using eprosima::fastrtps::types::ReturnCode_t;
using Bytes = std::vector<uint8_t>;
using Values = std::map<std::string, std::string>;  // JSON, flat: {"qos": {"depth": 5}} is "qos.depth" = "5"

namespace {

constexpr size_t LARGEST = 4 << 20;
std::mutex mutex;
std::condition_variable changed;

// Samples that are bytes, encapsulation included.
class Opaque : public TopicDataType {
public:
    explicit Opaque(const std::string& name) {
        setName(name.c_str());
        m_typeSize = LARGEST;
        m_isGetKeyDefined = false;
        auto_fill_type_information(false);
        auto_fill_type_object(false);
    }
    bool serialize(void* data, SerializedPayload_t* payload) override {
        const auto& bytes = *static_cast<Bytes*>(data);
        payload->encapsulation = CDR_LE;
        payload->length = static_cast<uint32_t>(bytes.size());
        std::memcpy(payload->data, bytes.data(), bytes.size());
        return true;
    }
    bool deserialize(SerializedPayload_t* payload, void* data) override {
        static_cast<Bytes*>(data)->assign(payload->data, payload->data + payload->length);
        return true;
    }
    std::function<uint32_t()> getSerializedSizeProvider(void* data) override {
        return [data] { return static_cast<uint32_t>(static_cast<Bytes*>(data)->size()); };
    }
    void* createData() override { return new Bytes; }
    void deleteData(void* data) override { delete static_cast<Bytes*>(data); }
    bool getKey(void*, InstanceHandle_t*, bool) override { return false; }
};

struct Node {
    DomainParticipant* participant = nullptr;
    Publisher* publisher = nullptr;
    Subscriber* subscriber = nullptr;
};

struct Inbox : DataReaderListener {
    std::vector<Bytes> got;
    void on_data_available(DataReader* reader) override {
        Bytes bytes;
        SampleInfo info;
        while (reader->take_next_sample(&bytes, &info) == ReturnCode_t::RETCODE_OK) {
            if (!info.valid_data) continue;
            std::lock_guard<std::mutex> lock(mutex);
            got.push_back(bytes);
            changed.notify_all();
        }
    }
};

struct Thing {
    Node* node = nullptr;
    std::string type;
    DataWriter* writer = nullptr;
    DataReader* reader = nullptr;
    std::unique_ptr<Inbox> inbox;
};

std::map<int, std::unique_ptr<Node>> nodes;
std::map<int, Thing> things;
int numbers = 0;

// JSON, as much as the commands need.

struct Parser {
    const std::string& text;
    size_t at = 0;
    Values values;

    void space() { while (at < text.size() && std::isspace(static_cast<unsigned char>(text[at]))) ++at; }
    char peek() { space(); if (at >= text.size()) throw std::runtime_error("JSON ends early"); return text[at]; }
    void expect(char c) { if (peek() != c) throw std::runtime_error(std::string("JSON lacks ") + c); ++at; }
    std::string quoted() {
        expect('"');
        std::string out;
        while (at < text.size() && text[at] != '"') {
            if (text[at] == '\\') {
                const char c = text.at(++at);
                if (c == 'u') {  // only characters of ASCII are sent that way
                    out += static_cast<char>(std::stoi(text.substr(at + 1, 4), nullptr, 16));
                    at += 4;
                } else {
                    out += c == 'n' ? '\n' : c == 't' ? '\t' : c;
                }
                ++at;
            } else {
                out += text[at++];
            }
        }
        ++at;
        return out;
    }
    void value(const std::string& name) {
        const char c = peek();
        if (c == '{') {
            ++at;
            while (peek() != '}') {
                const auto key = quoted();
                expect(':');
                value(name.empty() ? key : name + "." + key);
                if (peek() == ',') ++at;
            }
            ++at;
        } else if (c == '"') {
            values[name] = quoted();
        } else {
            const auto start = at;
            while (at < text.size() && text[at] != ',' && text[at] != '}') ++at;
            values[name] = text.substr(start, at - start);
        }
    }
};

std::string json(const std::string& text) {
    std::string out = "\"";
    for (const char c : text) {
        if (c == '"' || c == '\\') out += '\\';
        if (c == '\n') out += "\\n"; else out += c;
    }
    return out + "\"";
}

std::string get(const Values& values, const std::string& name, const std::string& fallback) {
    const auto found = values.find(name);
    return found == values.end() ? fallback : found->second;
}

// CDR.

void put(Bytes& out, uint32_t number) {
    for (int shift = 0; shift < 32; shift += 8) out.push_back(static_cast<uint8_t>(number >> shift));
}

uint32_t number_at(const Bytes& in, size_t at) {
    uint32_t number = 0;
    for (int n = 0; n < 4; ++n) number |= static_cast<uint32_t>(in.at(at + n)) << (8 * n);
    return number;
}

Bytes text_message(const std::string& text) {
    Bytes out = {0, 1, 0, 0};
    put(out, static_cast<uint32_t>(text.size() + 1));
    out.insert(out.end(), text.begin(), text.end());
    out.push_back(0);
    return out;
}

Bytes bytes_message(size_t size, size_t n) {
    Bytes out = {0, 1, 0, 0};
    put(out, 0);
    put(out, 0);
    put(out, static_cast<uint32_t>(size));
    for (size_t at = 0; at < size; ++at) out.push_back(static_cast<uint8_t>((at ? at : n) % 251));
    return out;
}

uint32_t crc32(const uint8_t* data, size_t size) {
    uint32_t crc = ~0u;
    for (size_t at = 0; at < size; ++at) {
        crc ^= data[at];
        for (int bit = 0; bit < 8; ++bit) crc = crc & 1 ? crc >> 1 ^ 0xEDB88320u : crc >> 1;
    }
    return ~crc;
}

std::string shown(const std::string& type, const Bytes& bytes) {
    if (type == "std_msgs/msg/String") {
        const auto size = number_at(bytes, 4);
        return "{\"data\": " + json(std::string(bytes.begin() + 8, bytes.begin() + 8 + size - 1)) + "}";
    }
    const auto size = number_at(bytes, 12);
    return "{\"data\": {\"size\": " + std::to_string(size) + ", \"sum\": "
           + std::to_string(crc32(bytes.data() + 16, std::min<size_t>(size, bytes.size() - 16))) + "}}";
}

// Commands.

std::string dds_name(const std::string& type) {
    const auto first = type.find('/'), last = type.rfind('/');
    return type.substr(0, first) + "::" + type.substr(first + 1, last - first - 1) + "::dds_::"
           + type.substr(last + 1) + "_";
}

template <class Policies>
void settle(Policies& qos, const Values& values) {
    const bool best_effort = get(values, "qos.reliability", "reliable") == "best_effort";
    const bool latched = get(values, "qos.durability", "volatile") == "transient_local";
    const auto depth = std::stoi(get(values, "qos.depth", get(values, "qos", "10")));
    qos.reliability().kind = best_effort ? BEST_EFFORT_RELIABILITY_QOS : RELIABLE_RELIABILITY_QOS;
    qos.durability().kind = latched ? TRANSIENT_LOCAL_DURABILITY_QOS : VOLATILE_DURABILITY_QOS;
    qos.history().kind = get(values, "qos.history", "") == "keep_all" ? KEEP_ALL_HISTORY_QOS : KEEP_LAST_HISTORY_QOS;
    qos.history().depth = depth;
    qos.endpoint().history_memory_policy = eprosima::fastrtps::rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
}

Topic* topic_of(Node& node, const std::string& name, const std::string& type) {
    if (auto* known = node.participant->lookup_topicdescription(name)) return static_cast<Topic*>(known);
    TypeSupport support(new Opaque(dds_name(type)));
    support.register_type(node.participant);
    return node.participant->create_topic(name, dds_name(type), TOPIC_QOS_DEFAULT);
}

void remove(Thing& thing) {
    if (thing.writer) thing.node->publisher->delete_datawriter(thing.writer);
    if (thing.reader) thing.node->subscriber->delete_datareader(thing.reader);
}

void reset() {
    for (auto& [number, thing] : things) remove(thing);
    things.clear();
    for (auto& [number, node] : nodes) {
        node->participant->delete_contained_entities();
        DomainParticipantFactory::get_instance()->delete_participant(node->participant);
    }
    nodes.clear();
}

void pause_of(const Values& values) {
    std::this_thread::sleep_for(std::chrono::duration<double>(std::stod(get(values, "period", "0"))));
}

std::string run(const Values& values) {
    const auto& command = values.at("do");
    const auto deadline = std::chrono::steady_clock::now()
                          + std::chrono::duration<double>(std::stod(get(values, "wait", "30")));
    if (command == "reset") {
        reset();
        return "null";
    }
    if (command == "node") {
        auto node = std::make_unique<Node>();
        DomainParticipantQos qos = DomainParticipantFactory::get_instance()->get_default_participant_qos();
        qos.name(values.at("name"));
        node->participant = DomainParticipantFactory::get_instance()->create_participant(
            static_cast<uint32_t>(std::stoi(values.at("domain"))), qos);
        if (!node->participant) throw std::runtime_error("no participant");
        node->publisher = node->participant->create_publisher(PUBLISHER_QOS_DEFAULT);
        node->subscriber = node->participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
        nodes[++numbers] = std::move(node);
        return std::to_string(numbers);
    }
    if (command == "publisher" || command == "subscription") {
        Thing thing;
        thing.node = nodes.at(std::stoi(values.at("node"))).get();
        thing.type = values.at("type");
        auto* topic = topic_of(*thing.node, "rt" + values.at("topic"), thing.type);
        if (command == "publisher") {
            DataWriterQos qos = DATAWRITER_QOS_DEFAULT;
            settle(qos, values);
            qos.publish_mode().kind = ASYNCHRONOUS_PUBLISH_MODE;  // what large samples ask for
            thing.writer = thing.node->publisher->create_datawriter(topic, qos);
        } else {
            DataReaderQos qos = DATAREADER_QOS_DEFAULT;
            settle(qos, values);
            thing.inbox = std::make_unique<Inbox>();
            thing.reader = thing.node->subscriber->create_datareader(topic, qos, thing.inbox.get());
        }
        if (!thing.writer && !thing.reader) throw std::runtime_error("no endpoint");
        things[++numbers] = std::move(thing);
        return std::to_string(numbers);
    }
    if (command == "publish" || command == "publish_bytes") {
        auto& thing = things.at(std::stoi(values.at("publisher")));
        const int count = std::stoi(get(values, "count", "1"));
        const bool numbered = !get(values, "number", "").empty();
        for (int n = 0; n < count; ++n) {
            Bytes bytes = command == "publish_bytes"
                              ? bytes_message(std::stoul(values.at("size")), n)
                              : text_message(values.at("message.data") + (numbered ? std::to_string(n) : ""));
            if (!thing.writer->write(&bytes)) throw std::runtime_error("write refused");
            pause_of(values);
        }
        return "null";
    }
    if (command == "take") {
        auto& thing = things.at(std::stoi(values.at("subscription")));
        const auto count = std::stoul(get(values, "count", "1"));
        std::unique_lock<std::mutex> lock(mutex);
        changed.wait_until(lock, deadline, [&] { return thing.inbox->got.size() >= count; });
        std::string out = "[";
        for (const auto& bytes : thing.inbox->got) out += (out.size() > 1 ? ", " : "") + shown(thing.type, bytes);
        thing.inbox->got.clear();
        return out + "]";
    }
    if (command == "matched") {
        auto& thing = things.at(std::stoi(values.at("thing")));
        const auto wanted = std::stoi(get(values, "count", "1"));
        int present = -1;
        while (true) {
            if (thing.writer) {
                PublicationMatchedStatus status;
                thing.writer->get_publication_matched_status(status);
                present = status.current_count;
            } else {
                SubscriptionMatchedStatus status;
                thing.reader->get_subscription_matched_status(status);
                present = status.current_count;
            }
            if (present == wanted || std::chrono::steady_clock::now() > deadline) return std::to_string(present);
            std::this_thread::sleep_for(std::chrono::milliseconds(2));
        }
    }
    if (command == "destroy") {
        const auto number = std::stoi(values.at("thing"));
        remove(things.at(number));
        things.erase(number);
        return "null";
    }
    throw std::runtime_error("unknown command " + command);
}

}  // namespace

int main() {
    DomainParticipantFactory::get_instance()->load_profiles();  // the file that the environment names
    std::string line;
    while (std::getline(std::cin, line)) {
        try {
            Parser parser{line, 0, {}};
            parser.value("");
            std::cout << "{\"result\": " << run(parser.values) << "}" << std::endl;
        } catch (const std::exception& error) {
            std::cout << "{\"error\": " << json(error.what()) << "}" << std::endl;
        }
    }
    reset();
    return 0;
}
