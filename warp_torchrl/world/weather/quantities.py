"""Quantities of weather: column names, ranges and units of each.

Names are in lower case, letters and digits alone. They are those of fire weather (Canadian, RAWS), of reanalyses, of
weather services, and words of English, Spanish, Portuguese, French, German and Italian.
"""

from dataclasses import dataclass

from warp_torchrl.world.weather import units as of
from warp_torchrl.world.weather.units import Units


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """A quantity of a weather table.

    Attributes:
        names: Names of its columns; of several columns, a name in an earlier set is taken.
        lowest: Lowest value, in our unit.
        highest: Highest value, in our unit.
        unit: Our unit.
        units: Units that a column may have.
        usual: Unit of a column that states none; None is an error.
    """

    names: tuple[frozenset[str], ...]
    lowest: float
    highest: float
    unit: str
    units: Units
    usual: str | None = None


def _quantity(names: str, limits: tuple[float, float], unit: str, units: Units, usual: str | None = None) -> Quantity:
    """Return a quantity; a stroke in the names separates preferred names from later ones."""
    tiers = tuple(frozenset(tier.split()) for tier in names.split("/"))
    return Quantity(names=tiers, lowest=limits[0], highest=limits[1], unit=unit, units=units, usual=usual)


QUANTITIES = {
    "wind_speed": _quantity(
        """
        ws windspeed windspd wspd wspeed windvelocity avgwindspeed averagewindspeed meanwindspeed wind sknt ws10m
        hourlywindspeed
        velocidaddelviento velocidadviento vientovelocidad velocidadmediadelviento
        velocidadedovento velocidadevento intensidadedovento intensidadevento intensidadeventokm ventovelocidade
        ventovelocidadehoraria
        vitesseduvent vitessevent windgeschwindigkeit velocitavento velocitadelvento
        """,
        (0, 100),
        "m/s",
        of.SPEED,
    ),
    "wind_bearing": _quantity(
        """
        winddirdeg / wd winddirection winddir wdir winddirdegree winddirdegrees winddeg windbearing windazimuth
        windfromdirection winddirectionfrom avgwinddirection prevailingwinddirection wd10m drct hourlywinddirection
        direcciondelviento direccionviento vientodireccion
        direcaodovento direcaovento rumodovento ventodirecao ventodirecaohoraria
        directionduvent directionvent windrichtung direzionevento direzionedelvento
        """,
        (0, 360),
        "deg",
        of.BEARING,
        "deg",
    ),
    "temperature": _quantity(
        """
        tmp temp temperature airtemp airtemperature tempair tair airtc drybulb drybulbtemp drybulbtemperature t2m
        2mtemperature hourlydrybulbtemperature
        temperatura temperaturadelaire temperaturaaire
        temperaturadoar temperaturaar temperaturadoarbulboseco temperaturadoarbulbosecohoraria
        temperaturedelair lufttemperatur
        """,
        (-60, 60),
        "c",
        of.TEMPERATURE,
    ),
    "humidity": _quantity(
        """
        rh humidity hum relativehumidity relhum relhumidity relh rhum rh2m hourlyrelativehumidity
        relativehumidityinpercentage
        humedad humedadrelativa
        humidade humidaderelativa umidade umidaderelativa umidaderelativadoar umidaderelativadoarhoraria
        humiditerelative relativeluftfeuchte umidita umiditarelativa
        """,
        (0, 100),
        "%",
        of.SHARE,
        "%",
    ),
    "dew_point": _quantity(
        "d2m 2mdewpointtemperature dewpoint dewpt dewpointtemp dewpointtemperature dwpt dwp",
        (-100, 60),
        "c",
        of.TEMPERATURE,
    ),
    "rain": _quantity(
        """
        apcp prec precip precipitation hrlypcp hrlyprecip hourlyprecip hourlyprecipitation prcp precipamount
        precipitationamount precipaccumonehour precipitationinlast60minutes p01i prectotcorr tp totalprecipitation
        precipitacion precipitacao precipitacaototal precipitacaototalhorario precipitations
        / rain rainfall rainamount hourlyrain lluvia chuva pluie
        """,
        (0, 500),
        "mm",
        of.RAIN,
    ),
    "wind_gust": _quantity(
        """
        gust gusts windgust windgusts wgust wgst gustspeed gustspd windgustspeed windgustspd hourlywindgustspeed ggst
        i10fg fg10 instantaneous10mwindgust 10mwindgustsincepreviouspostprocessing wpgt
        rafaga rajada rafale raffica windboe
        """,
        (0, 150),
        "m/s",
        of.SPEED,
    ),
    "cloud": _quantity("cloudcover cloudcov cloud clouds totalcloudcover tcc skycover", (0, 100), "%", of.SHARE, "%"),
    "wind_u": _quantity("u10 u10m 10mucomponentofwind windu ucomponentofwind", (-100, 100), "m/s", of.SPEED),
    "wind_v": _quantity("v10 v10m 10mvcomponentofwind windv vcomponentofwind", (-100, 100), "m/s", of.SPEED),
    "ffmc": _quantity("hffmc / ffmc finefuelmoisturecode", (0, 101), "", of.NONE, ""),
    "dmc": _quantity("dmc duffmoisturecode", (0, 2000), "", of.NONE, ""),
    "dc": _quantity("dc droughtcode", (0, 5000), "", of.NONE, ""),
    "bui": _quantity("bui buildupindex", (0, 2000), "", of.NONE, ""),
    **{f"dead_{hours}h": _quantity(f"dead{hours}h", (0, 400), "%", of.SHARE, "%") for hours in (1, 10, 100)},
    **{f"live_{what}": _quantity(f"live{what}", (0, 600), "%", of.SHARE, "%") for what in ("herbaceous", "woody")},
}
"""By the name of a field; dew point and components of the wind become others."""
ASKED = ("wind_gust", "cloud")
"""Quantities that are read where something needs them; a cell of theirs may be missing."""
OWNER = {each: name for name, quantity in QUANTITIES.items() for tier in quantity.names for each in tier}
"""The quantity that a name is one of."""
STATED = {"sknt": "kt", "p01i": "in", "airtc": "c", "intensidadeventokm": "km/h"}
"""Names that say a unit by what they abbreviate."""
SHOWN_NAMES = {
    "wind_speed": "ws, windspeed, windspd, wind_speed",
    "wind_bearing": "wd, winddirection, winddir, wind_direction, wind_dir, wind_bearing",
}
"""Names that messages show."""
