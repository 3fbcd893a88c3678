"""Tests that every ROS 2 type, alone and in arrays, is exported and recovered exactly.

The messages' bytes are what rclpy (Jazzy, Fast DDS) makes of `values`; with their padding.
"""

import base64
import csv
import json
import math
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from mcap.writer import Writer

from slosh_bag.interchange.export import export_targets, export_topics
from slosh_bag.interchange.rosbag_import import import_rosbag
from slosh_bag.reader import BagReader

KIND, INNER = "all_types_msgs/msg/All", "all_types_msgs/msg/Inner"
EXTREMES: dict[str, tuple[Any, Any, Any, Any]] = {
    "bool": (True, False, True, True),
    "byte": (255, 0, 128, 1),
    "char": (255, 0, 128, 65),
    "int8": (-128, 127, -1, 0),
    "uint8": (255, 0, 128, 1),
    "int16": (-(2**15), 2**15 - 1, -1, 0),
    "uint16": (2**16 - 1, 0, 2**15, 1),
    "int32": (-(2**31), 2**31 - 1, -1, 0),
    "uint32": (2**32 - 1, 0, 2**31, 1),
    "int64": (-(2**63), 2**63 - 1, -1, 0),
    "uint64": (2**64 - 1, 0, 2**63, 1),
    "float32": (0.5, -1.25, 3.0e38, 0.0),
    "float64": (0.1, -1e-300, 1e300, 0.0),
    "string": ("Größe 夜", "", 'a,b\n"c"', "x"),
    "wstring": ("Größe 𝄞 夜", "", 'a,b\n"c"', "x"),
}
DEFINITION = (
    "\n".join(
        f"{kind} a_{kind}\n{kind}[3] fixed_{kind}\n{kind}[<=4] bounded_{kind}\n{kind}[] any_{kind}"
        for kind in EXTREMES
    )
    + """
string<=10 limited_string
wstring<=10 limited_wstring
string<=10[<=3] limited_strings
Inner inner
Inner[2] inner_fixed
Inner[<=3] inner_bounded
Inner[] inner_any
float64[70] long_fixed
byte[70] long_bytes
int8[70] long_int8
"""
)
INNER_DEFINITION = "int8 small\nstring name\nbyte[3] raw\nwstring wide\n"
SCHEMA = f"{DEFINITION}{'=' * 80}\nMSG: all_types_msgs/Inner\n{INNER_DEFINITION}"


def inner(k: int) -> dict[str, Any]:
    """Returns the values of a nested message."""
    return {"small": -k, "name": f"n{k}", "raw": [255, k, 0], "wide": "é" * k}


def values(k: int) -> dict[str, Any]:
    """Returns the values of message number k, in the order of the fields."""
    found: dict[str, Any] = {}
    for kind, extremes in EXTREMES.items():
        found[f"a_{kind}"] = extremes[k % 4]
        found[f"fixed_{kind}"] = list(extremes[:3])
        found[f"bounded_{kind}"] = list(extremes[:k])
        found[f"any_{kind}"] = list(extremes) * k
    return found | {
        "limited_string": "0123456789"[:k],
        "limited_wstring": "0123456789"[k:],
        "limited_strings": ["a", "", "é"][:k],
        "inner": inner(k),
        "inner_fixed": [inner(1), inner(2)],
        "inner_bounded": [inner(3)] * k,
        "inner_any": [inner(n) for n in range(2 * k)],
        "long_fixed": [0.1 * n for n in range(70)],
        "long_bytes": [(n + 200) % 256 for n in range(70)],
        "long_int8": [n - 100 for n in range(70)],
    }


SERIALISED = (
    (
        "c-ocI-A|HH90%~ji-L%S2#DCqxw`WL#j>_Gp1Ur)s^-?(l$m#~v2`1G*ZL1~lvLV#mc3Z^W=U_BmZqgvrlnG"
        "p6^8Mm$kXrPd?7=-=xkrkIluEc=fJ}rCSyz{WAw?JC^Gj-W4GHSu2iRyTXcy_){^5t>wN5{vI}czw`897B~4"
        "-^qvi&6W$a0xky+0?lbW5!+vRVsaixk)ho#nOPxaNIX!p8?)<(~Mc5v%d)q#}LQnopL9lqwelIa%DvU&319W"
        "ut%)YX*LYDyiY>5Dazr8p^J$~dJ?`kj=@5ysYz@$s7K|Fcq4N%v98D7Cmty4is~)so+DeJmoaTPfv~3W`lSm"
        "$H$viBd(`Oxcp!NKZ;ZU4xa;vyCSI7tuK%N!H4lD8tzSN@7Ed*DIJPr(TYFfGux-KldJcrA=ysn2*}Inm~Qh"
        "UcXmreyj)VeZ5kffeWHO3m?Mz9QK9bqHr;|1-Lj|0*(p1&IImd0$-O4e4j$#ObMri%Yw^>Q^Bd>)Nna)8n|3"
        "IEu0oE4{jCQYB(M0I(VIsT(;$7Up|~3P7kNYIR$V9a0WO7oB_@VXM{7sncz%tg>Z#%W;ipP8LkMf2+jg$fwR"
        "CB!xalpdY(S(?R);Bf8gcd(5u(OBcpHLz8iZ#KJnq><kYnP)91jKuQT7i{|L_h49)!tN20O$h4^AZWHPxznU"
        "$?l=V)@Zd7dLjo4v=5pJ-`4dFu3;v**rVXuEi+{qmKo*E+7>=)8IB_MN+3_wIN59z1;X_}@2Lw>P%!+ClHn&"
        "|+i{y%)NjeC{3Q^Wbhi-&fD){SH3=4Vhusss"
    ),
    (
        "c-pm-$xjqf5XRrkG%yT<4*O=5aOMCEiY6x0p1gYHVg!QT2q7`y<cv4}1q})+xG&(+iW>@ovdQKGDuS};D6$A"
        "ngDlT_{l13DWH@-RlA3z;)vv1Fbh?>^F=k;FBX}88%#<^q(0Hq+3(ZJP4IHKWygn}%ny*cAl(I0Kh0Z?i<p#"
        "@qQkRN27{9WIV;>aG#S|jBV9`&xf@tat7Ielu&Xq8FW{0M8X<oK5i<|SzU9L_|XF)s5gYr<Gh1e##+~2*v-?"
        "*PIC=bU=t7)PikBE~EMPBG0Jd1T*B!_x5y>Nc9c}H2@@lz*-HG0gv>L@$0cf8=3=s(b_>1JKbsSnCSdGi*=-"
        "abutQrKV7qP0|)W=_;rNxfgw?G%c#iyc`dS%wzMDPc6Dmu?>1Yo&7~lh4~Bc=8JJ0Qm@csd$d$`GbsYAC~8B"
        "h4PM3Vh(vWc`^F4$V(6{|2R|mPj{#!7ymPd{%17BT=G0}x0p%3lYAF>0r_t7J?OI<vpKU-EX!r|u4=l_{rK*"
        "}>1(E*$GDYrD|A0*u9|f><2I_>g6e+kWW!P~%V8Ve+$Q@>Gv6l}+dcViVFSpAJdzrPKIS=cSlA@$eouFouqk"
        "k}(C5I<qrQN?0JuePOW>Blt$<qt$5g2^Rq_^9)~%}Sv#AnOz$xG&z(s<K0%r$j2Nw;_0WJod6Py!VEVwP;wt"
        "{m(cY$}QM%f*QzBq94;Nro>V@?9N1aOJq62T>cO9Gb!E*V@hxMXlC;8MV)f=dOL3N8&?8n|?D>EP1AWq`|2U"
        "$%F2c6Gn%>Fw(uc>U(>yTPINA3hF$8X5ikWo&$6^6NMM_a9R~r)Os8e$6lZ4(N+Zf0kEP*Eq9SZAwIBls(!J"
        "<BY93eWtqR?78!`br&vPx_ss8wd*%-);HX`edn%r?|$QhhmRgVX?pssx#f9l+l$RNj!tX(L3*!UGcu}(<%l("
        "iy@+g9#vH`ID7AZo"
    ),
    (
        "c-pm=*-sNu6voeVfuR&-UyTwH-*^CuqKQezC;kRrOn{(o#E_WyWb2#%f(8W@+&5fM6h*-e1vf-NMNk&4qJki"
        "cEZ2MIeuHD_u$XX@ulJnq{LZ<zoi-^cM2bR+jrh)`>boK=#m~qud<LJVickoDt1iEf3E%INK2N1A<}gw6F}+"
        "7bDt5;H+4WbwpP^rO6w_{yq6hPktEL#7RX!KXvt+KCVtHEVJb0Ed-*g`euB#S)(7ff==lRC@!F6%IGlXw`Z?"
        "uH^KusZk;^ZZ&Y!ETd({t4ngPWI^@1lKM`ttT1*e_O{w_s$Vab0QkUc)!;A6!>0e4~$+SQm2&GmBgq#Tn%0a"
        "ei4-ZBs=_dVf_pDIpkfpM|)k&e*+7He7gInOsF&F0Kr&V(cQ%=PKhG<Lc%r;Y#Pq?I2p)CF3;(@{Gmi+5Tgu"
        "x&rr5@cvh7uAM6@Ti!i~%OmD-ZQ$C-mB+P-YcoC*8|LcIYF74_<`6S#0f=FCX*Mwhd_cBX_K0}KsC$Un5eH0"
        "~@hx0;;5(!<Sv2>%wY-nd`aX-@#k`E)ncSPbxgN3Fkav0|)dRoRyJNdp1E>eQtu0~=f*XQA41NUlQS^<0n*c"
        "WnZVKEqxLI(dNuM;yE1Im^G}&j@B<29;0Otf31}+?&3Qh$V0nP<35}X^H8(b8)Rp3^Gi-sQ!K3dbuo*4ASfQ"
        "tne3oaIO;=sj$iw74EE*@M0xCC&C;1a<lf=dFI1TGm|GPq=LDd1ATrGiTZmkKToT$=W<`O)K+)+bM&J%7>mv"
        "i;TTj?Oo4-*vt3?)mVsx37QT)91jKuY=#d{}>wnIWqcdY<yz!_tf;vEaU%D><(vGxEkS#bVrpRJXBG6_{h<!"
        ">SM=GoIG{<%-M72FVtMTbool{)oXRvZ`9ws)o}YxW7FMx_a9iFNQ<nU>+8q2`TpikTHg8tK!B?*"
    ),
)


def write(path: Path, repeats: int = 1) -> BagReader:
    """Writes a bag with the three messages, repeated several times."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        schema = writer.register_schema(KIND, "ros2msg", SCHEMA.encode())
        channel = writer.register_channel("/all", "cdr", schema)
        for n in range(3 * repeats):
            data = zlib.decompress(base64.b85decode(SERIALISED[n % 3]))
            writer.add_message(channel, n + 1, data, n + 1)
        writer.finish()
    return BagReader(path)


def flat(found: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Returns values by table column, with short arrays and nested messages expanded."""
    columns: dict[str, Any] = {}
    for name, value in found.items():
        kind = name.rpartition("_")[2]
        if isinstance(value, dict):
            columns |= flat(value, f"{prefix}{name}.")
        elif (name.startswith("fixed_") and "string" not in kind) or name == "raw":
            columns |= {f"{prefix}{name}[{k}]": item for k, item in enumerate(value)}
        else:
            columns[f"{prefix}{name}"] = value
    return columns


def same(kind: str, got: Any, value: Any) -> bool:
    if isinstance(value, float):
        return got == (float(np.float32(value)) if "32" in kind else value)
    return got == value and type(got) is type(value)


@pytest.mark.parametrize("repeats", [1, 200])
def test_parquet_holds_every_type(tmp_path: Path, repeats: int):
    output = tmp_path / "all.parquet"
    bag = tmp_path / "all.mcap"
    reader = write(bag, repeats)
    export_topics(reader, export_targets(bag, reader, [], output))
    rows = pq.read_table(output).to_pylist()
    assert len(rows) == 3 * repeats
    for n in (0, 1, 2, len(rows) - 1):
        expected = flat(values(n % 3))
        assert list(rows[n]) == ["log_ns", "publish_ns", *expected]
        for name, value in expected.items():
            got = rows[n][name]
            if isinstance(got, bytes):
                got = list(got)
            pairs = zip(got, value, strict=True) if isinstance(value, list) else [(got, value)]
            assert all(same(name, *pair) for pair in pairs), (name, got, value)


@pytest.mark.parametrize("repeats", [1, 200])
def test_csv_holds_every_type(tmp_path: Path, repeats: int):
    output = tmp_path / "all.csv"
    bag = tmp_path / "all.mcap"
    reader = write(bag, repeats)
    export_topics(reader, export_targets(bag, reader, [], output))
    with output.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 3 * repeats
    for n in (0, 1, 2, len(rows) - 1):
        for name, value in flat(values(n % 3)).items():
            text = rows[n][name]
            got = text if isinstance(value, str) else json.loads(text)
            pairs = zip(got, value, strict=True) if isinstance(value, list) else [(got, value)]
            for one, other in pairs:
                if isinstance(other, float):
                    assert math.isclose(one, other, rel_tol=1e-7 if "32" in name else 0.0), name
                else:
                    assert one == other, name


def test_every_type_is_imported_byte_for_byte(tmp_path: Path):
    bag = tmp_path / "all.mcap"
    before = [message.data for message in write(bag).messages()]
    told = import_rosbag(bag, tmp_path / "new")
    assert (told.counts, told.notes, told.lost) == ({"/all": 3}, (), ())
    reader = BagReader(tmp_path / "new")
    assert [message.data for message in reader.messages()] == before
    assert reader.decode(next(iter(reader.messages()))).a_wstring == EXTREMES["wstring"][0]
