// A client of `tissuewarp serve` by Debian's OpenIGTLink library, as 3D Slicer and PLUS are:
//     igtl_client PORT < pairs
// Each line of pairs is a name and two places, RAS mm. Sends them and a surface of the fixed places, asks for an
// update, and prints STATUS, STRING, targets and the organ as the library unpacks them, in the order in which they
// come.

#include <igtlClientSocket.h>
#include <igtlImageMessage.h>
#include <igtlMessageHeader.h>
#include <igtlPointMessage.h>
#include <igtlPolyDataMessage.h>
#include <igtlStatusMessage.h>
#include <igtlStringMessage.h>
#include <igtlTransformMessage.h>

#include <cstdlib>
#include <cstring>
#include <iomanip>
#include <iostream>
#include <string>
#include <vector>

namespace {

struct Pair {
    std::string name;
    float moving[3], fixed[3];
};

std::vector<Pair> read_pairs() {
    std::vector<Pair> pairs;
    for (Pair p;
         std::cin >> p.name >> p.moving[0] >> p.moving[1] >> p.moving[2] >> p.fixed[0] >> p.fixed[1] >> p.fixed[2];)
        pairs.push_back(p);
    return pairs;
}

bool send(igtl::ClientSocket* socket, igtl::MessageBase* message) {
    message->Pack();
    return socket->Send(message->GetPackPointer(), message->GetPackSize()) != 0;
}

bool send_points(igtl::ClientSocket* socket, const char* device, const std::vector<Pair>& pairs, bool fixed) {
    auto message = igtl::PointMessage::New();
    message->SetDeviceName(device);
    for (const Pair& pair : pairs) {
        auto point = igtl::PointElement::New();
        point->SetName(pair.name.c_str());
        const float* place = fixed ? pair.fixed : pair.moving;
        point->SetPosition(place[0], place[1], place[2]);
        message->AddPointElement(point);
    }
    return send(socket, message);
}

bool send_identity(igtl::ClientSocket* socket) {
    igtl::Matrix4x4 matrix;
    igtl::IdentityMatrix(matrix);
    auto message = igtl::TransformMessage::New();
    message->SetDeviceName("start");
    message->SetMatrix(matrix);
    return send(socket, message);
}

bool send_image(igtl::ClientSocket* socket) {
    auto message = igtl::ImageMessage::New();
    message->SetDeviceName("fixed");
    message->SetDimensions(4, 3, 2);
    message->SetSpacing(1, 2, 3);
    message->SetScalarType(igtl::ImageMessage::TYPE_INT16);
    message->AllocateScalars();
    std::memset(message->GetScalarPointer(), 0, static_cast<std::size_t>(message->GetImageSize()));
    return send(socket, message);
}

bool ask(igtl::ClientSocket* socket, const char* text) {
    auto message = igtl::StringMessage::New();
    message->SetDeviceName("request");
    message->SetString(text);
    return send(socket, message);
}

/// Receives the body of a message of this type; null where its checksum or its content is wrong.
template <class Type>
typename Type::Pointer body(igtl::ClientSocket* socket, igtl::MessageHeader* header) {
    auto message = Type::New();
    message->SetMessageHeader(header);
    message->AllocatePack();
    if (socket->Receive(message->GetPackBodyPointer(), message->GetPackBodySize()) == 0) return nullptr;
    return (message->Unpack(1) & igtl::MessageHeader::UNPACK_BODY) ? message : nullptr;
}

void print_organ(igtl::PolyDataMessage& mesh) {
    std::cout << "organ " << mesh.GetPoints()->GetNumberOfPoints() << ' ' << mesh.GetPolygons()->GetNumberOfCells();
    for (int n = 0; n < mesh.GetNumberOfAttributes(); ++n)
        std::cout << ' ' << mesh.GetAttribute(static_cast<unsigned>(n))->GetName();
    std::cout << '\n';
    for (int n = 0; n < mesh.GetPoints()->GetNumberOfPoints(); ++n) {
        float place[3];
        mesh.GetPoints()->GetPoint(static_cast<unsigned>(n), place);
        std::cout << place[0] << ' ' << place[1] << ' ' << place[2] << '\n';
    }
}

/// True when the organ has come after the answer.
bool receive(igtl::ClientSocket* socket, bool& answered) {
    auto header = igtl::MessageHeader::New();
    header->InitPack();
    if (socket->Receive(header->GetPackPointer(), header->GetPackSize()) != header->GetPackSize()) std::exit(1);
    header->Unpack();
    const std::string type = header->GetDeviceType();
    if (type == "STATUS") {
        const auto status = body<igtl::StatusMessage>(socket, header);
        if (!status) std::exit(1);
        std::cout << "status " << status->GetCode() << ' ' << status->GetStatusString() << '\n';
    } else if (type == "STRING") {
        const auto text = body<igtl::StringMessage>(socket, header);
        if (!text) std::exit(1);
        std::cout << "string " << text->GetString() << '\n';
        answered |= std::strstr(text->GetString(), "\"sequence\":2") != nullptr;
    } else if (type == "POINT") {
        const auto points = body<igtl::PointMessage>(socket, header);
        if (!points) std::exit(1);
        std::cout << "points " << points->GetNumberOfPointElement() << '\n';
    } else if (type == "POLYDATA") {
        const auto mesh = body<igtl::PolyDataMessage>(socket, header);
        if (!mesh) std::exit(1);
        if (answered) print_organ(*mesh);
        return answered;
    } else {
        socket->Skip(header->GetBodySizeToRead(), 0);
    }
    return false;
}

}  // namespace

int main(int count, char** arguments) {
    if (count != 2) return 2;
    auto socket = igtl::ClientSocket::New();
    if (socket->ConnectToServer("127.0.0.1", std::atoi(arguments[1])) != 0) return 1;
    socket->SetReceiveTimeout(60000);
    const std::vector<Pair> pairs = read_pairs();
    std::cout << std::setprecision(9);
    const bool sent = send_points(socket, "moving_points", pairs, false) &&
                      send_points(socket, "fixed_points", pairs, true) && send_identity(socket) && send_image(socket) &&
                      ask(socket, R"({"do":"forget","sequence":1,"names":["fixed"]})") &&
                      ask(socket, R"({"do":"update","sequence":2,"points_sd_mm":0.5})");
    if (!sent) return 1;
    for (bool answered = false; !receive(socket, answered);) {
    }
    socket->CloseSocket();
}
